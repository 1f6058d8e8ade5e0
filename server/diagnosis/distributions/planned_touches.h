// Touches of a plan on one object, as a model reports them.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <absl/status/statusor.h>

#include "server/geometry/surface/surface.h"
#include "server/model/model.h"
#include "server/touch/commanded_touch.h"
#include "server/touch/plan.h"

namespace touchstone::diagnosis::distributions {

struct PlannedTouches {
  std::vector<touch::CommandedTouch> touches;
  std::vector<uint64_t> numbers;  // [touch], in their plan
  uint64_t seed = 0;              // of poses and noise
};

// The touches `numbers` of a faces plan; those that would miss under `model` are drawn again, up to 64 times.
absl::StatusOr<PlannedTouches> DrawPlannedTouches(std::shared_ptr<const model::Model> model,
                                                  std::shared_ptr<const geometry::Surface> surface,
                                                  const touch::Plan& plan,
                                                  const std::vector<uint64_t>& numbers, uint64_t seed);

// Their reported times, [touch * fingers + finger], seconds, noise included; NaN: reported nothing.
absl::StatusOr<std::vector<double>> SimulatePlannedTouches(std::shared_ptr<const model::Model> model,
                                                           std::shared_ptr<const geometry::Surface> surface,
                                                           const PlannedTouches& drawn);

// Both in one: a pure function of its arguments. A touch that misses for good stays NaN.
absl::StatusOr<std::vector<double>> SimulatePlan(std::shared_ptr<const model::Model> model,
                                                 std::shared_ptr<const geometry::Surface> surface,
                                                 const touch::Plan& plan,
                                                 const std::vector<uint64_t>& numbers, uint64_t seed);

}  // namespace touchstone::diagnosis::distributions
