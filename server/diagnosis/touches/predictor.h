// Predictions of one experiment under many models: what is the same for all is prepared once.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "server/diagnosis/touches/prediction.h"
#include "server/touch/simulate.h"

namespace touchstone::diagnosis::touches {

using model::DeterministicPart;

class Predictor {
 public:
  // `observations` must outlive it.
  Predictor(const Observations& observations, ThreadPool* pool);

  // See Predict. Touches of one pose are simulated once, unless the model depends on the session's course.
  absl::StatusOr<Prediction> Run(const model::Model& model, bool details, bool curvature) const;

  // Times as a rig of this model would report them, random effects included. [k * fingers + finger]
  absl::StatusOr<std::vector<double>> Draw(const model::Model& model, uint64_t seed) const;

  // Contact travel of every touch with the whole end effector moved by `along_lateral_m` along the lateral
  // vector and by `along_binormal_m` along approach x lateral. [k * fingers + finger]
  absl::StatusOr<std::vector<double>> TravelWhenMoved(const model::Model& model, double along_lateral_m,
                                                      double along_binormal_m) const;

  // The first touch of every pose, in batches of one object, by several threads at once: `body` is given the
  // batch's number, its touches, and what fills them into a batch for a simulator. `previous_press_m`: [k *
  // fingers + finger].
  using FillBatch = std::function<void(const touch::TouchSimulator&, effects::TouchBatch*)>;
  void ForPoses(const std::vector<double>& previous_press_m,
                const std::function<void(int, const std::vector<int>&, const FillBatch&)>& body) const;
  int pose_batches() const { return static_cast<int>(pose_blocks_.size()); }

  const Observations& observations() const { return observations_; }

 private:
  // Touches of one object that are simulated together.
  struct Block {
    int object = 0;
    std::vector<int> touches;  // k of each line of the batch
  };
  class Task;
  static std::vector<Block> MakeBlocks(const Observations& observations, const std::vector<int>& touches);
  void Fill(const Block& block, const touch::TouchSimulator& simulator, effects::TouchBatch* batch) const;
  void ForBlocks(const std::vector<Block>& blocks, const std::function<void(const Block&)>& body) const;

  const Observations& observations_;
  ThreadPool* pool_;
  std::vector<int> first_of_pose_;  // pose -> its first touch
  std::vector<Block> pose_blocks_;
  std::vector<Block> touch_blocks_;
};

}  // namespace touchstone::diagnosis::touches
