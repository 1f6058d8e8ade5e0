// Whether a request is one that a source works on: counts, ids, names, sizes. Errors name the field, what was
// found and what would be right.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/dataset/specification.h"
#include "server/source/source_limits.h"

namespace touchstone::source {

// 1 to 64 letters, digits, '_', '-' or '.', not '.' first.
absl::Status CheckResourceName(const std::string& name, const std::string& field);

// The name of a session; an empty one is "default".
absl::StatusOr<std::string> SessionName(const std::string& name);

// At least one touch where `at_least` is 1.
absl::Status CheckTouchCount(size_t touches, const SourceLimits& limits, size_t at_least = 1);

// None, or one per touch, of 1 to 256 printable bytes.
absl::Status CheckTouchIds(const std::vector<std::string>& ids, size_t touches);

// Views of one answer: how many, and how many bytes their pictures may have.
absl::Status CheckViews(size_t views, const dataset::DatasetImage& image, const SourceLimits& limits);

absl::Status CheckBatchSize(uint32_t batch_size, const SourceLimits& limits);

// Samples that are asked for one by one.
absl::Status CheckIndices(size_t indices, const SourceLimits& limits);

}  // namespace touchstone::source
