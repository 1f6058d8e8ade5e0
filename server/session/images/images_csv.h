// images.csv of an image set (format: measurement_files.md): one photograph per row, without its pixels.
#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "server/session/images/image_set.h"

namespace touchstone::session {

inline constexpr size_t kMaxPhotographs = 100'000;
inline constexpr size_t kMaxPictureNameBytes = 1024;

// INVALID_ARGUMENT unless the name leads to a file inside the folder that is none of the set's own.
absl::Status CheckPictureName(absl::string_view name);

// Fills objects, photographs (all but channels and pixels) and the has_ fields of a set. Errors name `origin`, line,
// column, what is wrong and what was expected; nothing is dropped.
absl::StatusOr<ImageSet> ParseImagesCsv(absl::string_view csv, const std::string& origin);

// Which optional columns a file has.
struct ImageColumns {
  bool session_time = false, round = false, touch = false, measured = false;
  std::vector<std::string> covariates;
};
// Those that any row of the set fills.
ImageColumns ColumnsOf(const ImageSet& set);

// One line, its end included.
std::string ImagesCsvHeader(const ImageColumns& columns);
std::string ImagesCsvRow(const PhotographRow& row, const std::string& object, const ImageColumns& columns);
// The whole file; reads back to the same set.
std::string FormatImagesCsv(const ImageSet& set);

}  // namespace touchstone::session
