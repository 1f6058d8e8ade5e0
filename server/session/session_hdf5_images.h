// The pictures of a journal's session in its HDF5 file, under /images. Internal to session/.
#pragma once

#include <vector>

#include <absl/status/status.h>

#include "server/session/hdf5/hdf5_file.h"
#include "server/session/journal/journal.h"

namespace touchstone::session {

void WriteHdf5Images(const std::vector<JournalImage>& images, Hdf5Columns* columns);
// `rows` pictures; without views where the file is of before those were kept.
absl::Status ReadHdf5Images(const Hdf5ColumnsReader& file, uint64_t rows, std::vector<JournalImage>* images);

}  // namespace touchstone::session
