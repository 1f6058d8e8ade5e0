// A dataset that a rig makes touch by touch.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/source/physical_source.h"
#include "server/touch/plan_drawer.h"

namespace touchstone::source {

class PhysicalSamples final : public SampleStream {
 public:
  // `device` must outlive the stream. Errors name the field of the request.
  static absl::StatusOr<std::unique_ptr<SampleStream>> Create(const SampleRequest& request, RigDevice* device,
                                                              Rectifier rectify);

  const SampleHeader& header() const override { return header_; }
  absl::StatusOr<std::optional<dataset::DatasetBatch>> Next(const MotionGuard& guard) override;

 private:
  PhysicalSamples() = default;
  // The touch of a sample: drawn again, within bounds, while a finger would miss, and touched again with a further draw
  // while one does miss. Its attempt goes to `attempt`.
  absl::StatusOr<std::pair<TouchCommand, session::JournalTouch>> MakeTouch(uint64_t index,
                                                                           const MotionGuard& guard,
                                                                           uint32_t* attempt) const;
  // Fills one row.
  absl::Status MakeSample(uint32_t row, const MotionGuard& guard, const dataset::BatchColumns& columns,
                          dataset::DatasetBatch* batch) const;

  SampleRequest request_;
  RigDevice* device_ = nullptr;
  Rectifier rectify_;
  SampleHeader header_;
  std::vector<std::unique_ptr<touch::PlanDrawer>> drawers_;  // one per object
  uint64_t next_index_ = 0;
};

}  // namespace touchstone::source
