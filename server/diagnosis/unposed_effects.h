// Which effects would make the sets of a model like a measured one without poses.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/base/thread_pool.h"
#include "server/model/model.h"

namespace touchstone {

struct CompatibleEffect {
  std::string effect;
  std::string values;  // for people: "radius_mm = 1.5"
  double p = 0;
};

// The distance of the measured set to a reference that a model makes, and its p.
struct UnposedMisfit {
  double distance = 0;
  double p = 0;
};
using MisfitOfModel = std::function<absl::StatusOr<UnposedMisfit>(std::shared_ptr<const Model>)>;

// Every effect of the catalogue and of `also`, one parameter at a time, with both signs and a few strengths
// around its typical one; the best strength of each, if its p is above 0.1. Most compatible first. `misfit`
// is called from several threads. Returns CANCELLED if `progress` (0 to 1, one call at a time) returns false.
absl::StatusOr<std::vector<CompatibleEffect>> FindCompatibleEffects(
    const Model& model, const std::vector<std::shared_ptr<const Effect>>& also, const MisfitOfModel& misfit,
    ThreadPool* pool, const std::function<bool(double done)>& progress);

}  // namespace touchstone
