// An image set as one HDF5 file, in SI so that every number comes back bit for bit; measurement_files.md has its datasets.
#pragma once

#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::session {

// The files of an image set, and the touches.csv of a joint one; empty: there is none.
struct ImageSetWithTouches {
  v1::ImageSetFiles images;
  std::string touches_csv;
};

// Whole or absent. The files are checked as ParseImageSet does, the touches kept as they are.
absl::Status WriteImageSetHdf5(const ImageSetWithTouches& set, const std::string& path);

// Whether a path leads to such a file (and not, for instance, to a journal's session).
bool IsImageSetHdf5(const std::string& path);

// The set that was written: the same pixels and numbers, in the bytes that FormatImageSet writes. Errors name the file
// and the dataset.
absl::StatusOr<ImageSetWithTouches> ReadImageSetHdf5(const std::string& path);

}  // namespace touchstone::session
