// Which effects would make the sets of a model like a measured one without poses.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/base/threads/thread_pool.h"
#include "server/diagnosis/distributions/pose_free_experiment.h"
#include "server/model/model.h"

namespace touchstone::diagnosis::distributions {

struct CompatibleEffect {
  std::string effect;
  std::string values;  // for people: "radius_mm = 1.5"
  double p_value = 0;  // of the measured set under the model with it
};

// How far the measured set is from a reference that a model makes, all measures together (no unit), and its
// p.
struct PoseFreeMisfit {
  double distance = 0;
  double p_value = 0;
};
using MisfitOfModel = std::function<absl::StatusOr<PoseFreeMisfit>(const std::shared_ptr<const model::Model>&,
                                                                   const AssumedPoses&, ReferenceSize)>;

// Makes another measure of misfit: against sets that this model makes with these poses.
using RenewMisfit = std::function<absl::StatusOr<MisfitOfModel>(const std::shared_ptr<const model::Model>&,
                                                                const AssumedPoses&)>;

// Screens every effect of the catalogue and of `also`, one number at a time, with both signs and a few
// strengths, coarsely and with each of `poses`; then refines the most promising, all entries of a parameter
// and the poses together, in the end by the misfit that `renew` makes of the best so far. Returns those whose
// p is above 0.1, most compatible first. `noise_is_known`: no effect that makes noise is tried. `misfit` is
// called from several threads. Returns CANCELLED if `progress` (0 to 1, one call at a time) returns false.
absl::StatusOr<std::vector<CompatibleEffect>> FindCompatibleEffects(
    const model::Model& model, bool noise_is_known,
    const std::vector<std::shared_ptr<const model::Effect>>& also, const std::vector<AssumedPoses>& poses,
    MisfitOfModel misfit, const RenewMisfit& renew, ThreadPool* pool,
    const std::function<bool(double done)>& progress);

}  // namespace touchstone::diagnosis::distributions
