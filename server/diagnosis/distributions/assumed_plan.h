// Sets without poses: how they were probably made, and sets made alike by a model.
#pragma once

#include <memory>
#include <vector>

#include <absl/status/statusor.h>

#include "server/geometry/surface.h"
#include "server/model/model.h"
#include "server/session/measurement_set.h"
#include "server/touch/plan.h"

namespace touchstone {

// The touches of one object in a set without poses.
struct UnposedObject {
  std::shared_ptr<const Surface> surface;
  std::vector<int> rows;         // of the set, in its order; thinned in large sets
  std::vector<uint64_t> number;  // in the plan that is supposed: rows[k] was touch number[k]
  Plan plan;                     // faces
  int repeats = 1;               // touches a pose, as the times show
  bool in_rounds = false;        // repeats stand a constant number of rows apart
};

// How the poses were probably spread: what a set without poses does not tell. The faces plan's usual ones.
struct SupposedPoses {
  double max_tilt_rad = FacesPlan().max_tilt_rad;
  double spread = FacesPlan().spread;
};
Plan WithPoses(const Plan& plan, const SupposedPoses& poses);

// How many touches of every pose the times show: 1 unless every touch has that many very close companions.
// `time_s` [touch * fingers + finger]; `in_rounds`: whether the set goes through all poses again and again.
int CountRepeats(const std::vector<double>& time_s, int fingers, bool* in_rounds);

// Object `object` of a set, with at most `max_touches` of its touches: whole poses.
UnposedObject SupposePlan(const MeasurementSet& set, int object, std::shared_ptr<const Surface> surface,
                          double speed_m_s, int max_touches);

// Standard deviation of one finger's time among the rounds of a pose, pooled over objects; `degrees` is 0 if
// there are no rounds.
double ScatterAmongRounds(const MeasurementSet& set, const std::vector<UnposedObject>& objects,
                          double* degrees);

// Touches that a rig is told to make.
struct UnposedTouches {
  std::vector<CommandedTouch> touches;
  std::vector<uint64_t> numbers;  // in their plan
  uint64_t seed = 0;              // of poses and noise
};
// The touches `numbers` of a plan; those that would miss under `model` are drawn again.
absl::StatusOr<UnposedTouches> DrawUnposed(std::shared_ptr<const Model> model,
                                           std::shared_ptr<const Surface> surface, const Plan& plan,
                                           const std::vector<uint64_t>& numbers, uint64_t seed);
// Their reported times [touch * fingers + finger], noise included.
absl::StatusOr<std::vector<double>> PlayUnposed(std::shared_ptr<const Model> model,
                                                std::shared_ptr<const Surface> surface,
                                                const UnposedTouches& drawn);

// Reported times [touch * fingers + finger] of the touches `numbers` of a plan, noise included. Touches that
// miss are drawn again; one that misses for good stays NaN. A pure function of its arguments.
absl::StatusOr<std::vector<double>> SimulateUnposed(std::shared_ptr<const Model> model,
                                                    std::shared_ptr<const Surface> surface, const Plan& plan,
                                                    const std::vector<uint64_t>& numbers, uint64_t seed);

}  // namespace touchstone
