#include "server/source/request_checks.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/base/text/over_limit.h"
#include "server/base/text/printable.h"

namespace touchstone::source {
namespace {

constexpr size_t kMaxIdBytes = 256;
constexpr uint64_t kMaxAnswerBytes = uint64_t{192} << 20;

}  // namespace

absl::Status CheckResourceName(const std::string& name, const std::string& field) {
  const bool plain =
      !name.empty() && name.size() <= 64 && name[0] != '.' &&
      name.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.-") ==
          std::string::npos;
  if (plain) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      field, " = '", name, "': must be 1 to 64 letters, digits, '_', '-' or '.', not '.' first"));
}

absl::StatusOr<std::string> SessionName(const std::string& name) {
  if (name.empty()) return std::string("default");
  TOUCHSTONE_RETURN_IF_ERROR(CheckResourceName(name, "session"));
  return name;
}

absl::Status CheckTouchCount(size_t touches, const SourceLimits& limits, size_t at_least) {
  if (touches < at_least) return absl::InvalidArgumentError("touches is empty: give at least one touch");
  if (touches > static_cast<size_t>(limits.max_touches_per_request))
    return OverLimit("touches has", touches, "max_touches_per_request", limits.max_touches_per_request);
  return absl::OkStatus();
}

absl::Status CheckTouchIds(const std::vector<std::string>& ids, size_t touches) {
  if (ids.empty()) return absl::OkStatus();
  if (ids.size() != touches)
    return absl::InvalidArgumentError(absl::StrCat(
        "touch_ids has ", ids.size(), ": give none, or one for each of the ", touches, " touches"));
  for (size_t k = 0; k < ids.size(); ++k)
    if (ids[k].empty() || ids[k].size() > kMaxIdBytes || !IsPrintableLine(ids[k]))
      return absl::InvalidArgumentError(absl::StrCat("touch_ids[", k, "] has ", ids[k].size(),
                                                     " bytes: 1 to ", kMaxIdBytes,
                                                     " printable ones were expected"));
  return absl::OkStatus();
}

absl::Status CheckViews(size_t views, const dataset::DatasetImage& image, const SourceLimits& limits) {
  if (views == 0) return absl::InvalidArgumentError("views is empty: give at least one view");
  if (views > static_cast<size_t>(limits.max_images_per_request))
    return OverLimit("views has", views, "max_images_per_request", limits.max_images_per_request);
  TOUCHSTONE_RETURN_IF_ERROR(dataset::CheckNormalize(image));
  const uint64_t bytes =
      uint64_t{3} * image.options.width * image.options.height * views * (image.options.depth ? 3 : 1);
  if (bytes > kMaxAnswerBytes)
    return absl::InvalidArgumentError(
        absl::StrCat("views has ", views, " of ", image.options.width, " x ", image.options.height,
                     " pixels: too much for one answer; ask for fewer at a time"));
  return absl::OkStatus();
}

absl::Status CheckBatchSize(uint32_t batch_size, const SourceLimits& limits) {
  if (batch_size <= static_cast<uint32_t>(limits.max_batch_size)) return absl::OkStatus();
  return OverLimit("batch_size =", batch_size, "max_batch_size", limits.max_batch_size);
}

absl::Status CheckIndices(size_t indices, const SourceLimits& limits) {
  if (indices <= static_cast<size_t>(limits.max_indices_per_request)) return absl::OkStatus();
  return OverLimit("indices has", indices, "max_indices_per_request", limits.max_indices_per_request);
}

}  // namespace touchstone::source
