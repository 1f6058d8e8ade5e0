// What the writers tell about one sample in words and numbers.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "client/source/dataset/batch.h"
#include "client/source/dataset/shard_writer.h"

namespace touchstone::client {

// The columns that stand for the commanded touch.
bool IsPoseColumn(const FileColumn& column);

// The name of the object that a sample shows.
absl::StatusOr<std::string> ObjectOfSample(const DatasetLayout& layout, const Batch& batch, uint64_t row);

// {"index":17,"object":"lat20","target_mm":[0,0,0],...}: the object, the pose and every scalar,
// in file units.
absl::StatusOr<std::string> SampleJson(const DatasetLayout& layout, const Batch& batch, uint64_t row);

// A row of a measurement file, line end included; needs the pose, and the contact times or the descriptor.
absl::StatusOr<std::string> SampleMeasurementRow(const DatasetLayout& layout, const Batch& batch,
                                                 uint64_t row);

// The batch's column for each of the layout's, checked for size and type. Pointers into the batch.
absl::StatusOr<std::vector<const v1::Column*>> MatchColumns(const DatasetLayout& layout, const Batch& batch);

}  // namespace touchstone::client
