// The oracle as a generator of `touchstone rehearse --generator` (server/README.md, "A generator of your own").
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "tests/hidden_effects/generator/generate.h"

namespace touchstone::hidden {

struct GeneratorRequest {
  std::string plan, model;  // paths
  std::map<std::string, std::string>
      meshes;                     // object -> path of a mesh in mm; of others the product's supershapes
  std::vector<std::string> hide;  // "tip_radius radius_mm=1.5", "outside"
  uint64_t seed = 0;
};

// The plan's touches on a rig that has what the model has and what is hidden. UNIMPLEMENTED: the oracle does not know such an
// effect. Errors name the plan, the model or the words.
absl::StatusOr<Set> GenerateForPlan(const GeneratorRequest& request);

}  // namespace touchstone::hidden
