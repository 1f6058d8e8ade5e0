// A folder with photographs (format: server/session/measurement_files.md) as the message that Evidence.images and
// CreateSession take, as server/session has it: clients and servers read and write it with the same code.
//
//   if (client::IsImageSetFolder(path)) {
//     TOUCHSTONE_ASSIGN_OR_RETURN(*evidence.mutable_images(), client::ReadImageSetFiles(path));
//     if (client::HasTouches(path)) ...   // PATH/touches.csv goes with it as measurements: a joint diagnosis
//   }
#pragma once

#include "server/session/images/image_set_file.h"

namespace touchstone::client {

using touchstone::session::HasTouches;
using touchstone::session::IsImageSetFolder;
using touchstone::session::kTouchesCsv;
using touchstone::session::ReadImageSetFiles;
using touchstone::session::WriteImageSetFiles;

}  // namespace touchstone::client
