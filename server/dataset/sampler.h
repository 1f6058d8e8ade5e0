// Draws and simulates the touches of a dataset, many at once: sorted so that neighbouring lines travel
// together, drawn again where a finger misses, each a pure function of its index.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/types/span.h>

#include "server/dataset/coherence.h"
#include "server/dataset/specification.h"
#include "server/touch/draw_check.h"
#include "server/touch/simulate.h"
#include "server/uncertainty/predicted_times.h"

namespace touchstone::dataset {

class TouchSampler {
 public:
  // `specification` must be valid and outlive the sampler.
  explicit TouchSampler(const DatasetSpecification& specification);
  ~TouchSampler();

  // Memory that one thread keeps between calls.
  struct Workspace {
    std::vector<uint32_t> slots, missed;  // samples that are still to be accepted
    std::vector<uint32_t> block_slots;    // the block in hand: its samples,
    std::vector<uint64_t> numbers;        // their numbers in the plan
    std::vector<touch::TouchPose> poses;  // and poses as commanded
    std::vector<uint64_t> previous_indices;
    std::vector<uint8_t> accepted;
    std::vector<double> previous_press_m;
    CoherentOrder order;
    effects::TouchBatch batch;
    touch::TouchWorkspace touch;
    touch::DrawCheck::Workspace check;
    std::vector<touch::DrawFlaw> flaws;
    uncertainty::PredictedTimes::Workspace predicted;
    uncertainty::TimeUncertainty uncertainty;
  };

  // A simulated block. Touch t of the batch is sample indices[slots[t]] if accepted[t]; else it is no touch of the
  // plan (touch/draw_check.h) and is drawn again. All are draw number `attempt` of their samples, from 0. Pose(t) is as commanded; effects may have changed the batch's own vectors.
  struct Block {
    const effects::TouchBatch& batch;
    absl::Span<const uint32_t> slots;
    absl::Span<const uint8_t> accepted;
    absl::Span<const touch::TouchPose> poses;
    uint32_t attempt = 0;
    const uncertainty::TimeUncertainty* uncertainty =
        nullptr;                                 // of the touches; null unless the columns ask for it
    absl::Span<const double> model_values = {};  // of the one sample's own model, if models are drawn
    const touch::TouchPose& Pose(int touch) const { return poses[touch]; }
  };
  // Called for every block, in no particular order.
  using Sink = std::function<void(const Block& block)>;

  // The model of a sample: its own where models are drawn.
  absl::StatusOr<std::shared_ptr<const model::Model>> ModelOf(uint64_t index) const;

  // Simulates the samples `indices`. Returns CANCELLED soon after `cancelled` becomes true. Thread-safe.
  absl::Status Sample(absl::Span<const uint64_t> indices, const std::atomic<bool>& cancelled,
                      Workspace* workspace, const Sink& sink) const;

 private:
  enum class Until { kMotion, kSensor };
  // A model, ready to simulate.
  struct Rig {
    explicit Rig(std::shared_ptr<const model::Model> of) : model(of), simulator(std::move(of)) {}
    std::shared_ptr<const model::Model> model;
    touch::TouchSimulator simulator;
  };
  absl::Status SampleWith(const Rig& rig, absl::Span<const uint64_t> indices,
                          const std::atomic<bool>& cancelled, Workspace* workspace, const Sink& sink) const;
  absl::Status SampleDrawn(absl::Span<const uint64_t> indices, const std::atomic<bool>& cancelled,
                           Workspace* workspace, const Sink& sink) const;
  absl::Status Run(const Rig& rig, absl::Span<const uint64_t> indices, Until until,
                   absl::Span<const double> previous_press_m, const std::atomic<bool>& cancelled,
                   Workspace* workspace, const Sink& sink) const;
  absl::Status RunObject(const Rig& rig, size_t object, absl::Span<const uint64_t> indices, Until until,
                         absl::Span<const double> previous_press_m, const std::atomic<bool>& cancelled,
                         Workspace* workspace, const Sink& sink) const;
  void DrawBlock(size_t object, absl::Span<const uint64_t> indices, uint32_t attempt,
                 Workspace* workspace) const;
  absl::Status RunBlock(const Rig& rig, size_t object, absl::Span<const uint64_t> indices, Until until,
                        absl::Span<const double> previous_press_m, Workspace* workspace) const;
  double PauseBefore(const touch::Plan& plan, uint64_t index) const;
  // The touches of workspace.block_slots.
  void FillBatch(const touch::TouchSimulator& simulator, size_t object, absl::Span<const uint64_t> indices,
                 absl::Span<const double> previous_press_m, const Workspace& workspace,
                 effects::TouchBatch* batch) const;
  absl::Status FollowToTheEnd(const Rig& rig, size_t object, uint64_t index,
                              const std::atomic<bool>& cancelled) const;
  uint64_t NumberOf(uint64_t index) const;

  const DatasetSpecification& specification_;
  const Rig rig_;                                                 // of the specification's model
  std::unique_ptr<const uncertainty::PredictedTimes> predicted_;  // null unless the columns ask for it
  std::unique_ptr<const uncertainty::ModelDraws> draws_;          // null unless models are drawn
  const touch::DrawCheck check_;
  std::vector<std::shared_ptr<const touch::PoseGenerator>> generators_;  // one per object
  bool plan_ends_ = false;
  std::vector<std::string> list_covariates_;  // that the model needs and every touch of a list carries
};

}  // namespace touchstone::dataset
