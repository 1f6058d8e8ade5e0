// The order in which touches are simulated: neighbours in start, target and lateral come one after another,
// so that their lines share nodes of the BVH. It changes speed, never a result.
#pragma once

#include <cstdint>
#include <vector>

#include <absl/types/span.h>

#include "server/touch/commanded_touch.h"

namespace touchstone {

struct CoherenceScratch {
  std::vector<uint64_t> keys, keys_swap;
  std::vector<uint32_t> order_swap;
};

// order becomes a permutation of 0 .. poses.size() - 1.
void CoherentOrder(absl::Span<const TouchPose> poses, CoherenceScratch* scratch,
                   std::vector<uint32_t>* order);

}  // namespace touchstone
