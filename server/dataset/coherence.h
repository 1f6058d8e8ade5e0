// The order in which touches are simulated: neighbours in start, target and lateral come one after another,
// so that their lines share nodes of the BVH. It changes speed, never a result.
#pragma once

#include <cstdint>
#include <vector>

#include <absl/types/span.h>

#include "server/touch/commanded_touch.h"

namespace touchstone::dataset {

class CoherentOrder {
 public:
  // Forgets all poses. `sample` are some of those to come: they set the scale of the keys.
  void Begin(absl::Span<const touch::TouchPose> sample);
  // Appends poses, in the order of their numbers 0, 1, 2, ...
  void Add(absl::Span<const touch::TouchPose> poses);
  // The numbers in the order in which to simulate. Equal poses keep their order. Valid until Begin.
  absl::Span<const uint32_t> Sort();

 private:
  struct Range {
    double lower = 0, factor = 0;
    uint64_t Quantise(double value) const;
  };
  Range start_[3], target_[3];
  std::vector<uint64_t> keys_, keys_swap_;
  std::vector<uint32_t> order_;
};

}  // namespace touchstone::dataset
