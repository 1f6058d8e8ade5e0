// A dataset that a physical source makes touch by touch. Sample i is journalled under the dataset's key and
// i, so that it is made once and given again whenever the dataset, or a part of it, is asked for in the same
// session.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/dataset/stream.h"
#include "server/source/rig_device.h"
#include "touchstone/v1/source.pb.h"

namespace touchstone {

// What decides the touches of a dataset (objects, plan, seed), as 16 hexadecimal digits; columns and images
// do not.
std::string DatasetKey(const v1::DatasetSpec& spec);

// The bytes that say whether two commands are the same: made from the exact command, whatever a client left
// unset.
std::string CommandBytes(const CommandedTouch& touch);

class PhysicalDataset {
 public:
  // `names` of the objects, as in the specification.
  static absl::StatusOr<PhysicalDataset> Create(std::shared_ptr<const DatasetSpecification> specification,
                                                std::vector<std::string> names, const DatasetPart& part,
                                                std::string session, std::string key, RigDevice* source);

  // The next batch; nothing at the end.
  absl::StatusOr<std::optional<DatasetBatch>> Next(const MotionGuard& guard);

 private:
  absl::Status AppendSample(uint64_t index, const MotionGuard& guard, DatasetBatch* batch) const;
  // The touch of a sample: drawn again, within bounds, while a finger misses.
  absl::StatusOr<std::pair<TouchCommand, JournalTouch>> MakeTouch(uint64_t index,
                                                                  const MotionGuard& guard) const;

  std::shared_ptr<const DatasetSpecification> specification_;
  std::vector<std::string> names_;
  std::vector<ColumnInfo> columns_;
  std::vector<std::unique_ptr<PoseGenerator>> generators_;  // one an object
  DatasetPart part_;
  std::string session_, key_;
  RigDevice* source_ = nullptr;
  uint64_t next_index_ = 0;
};

}  // namespace touchstone
