// How a set without poses was probably made: by a faces plan, whose repeats the times show.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "server/geometry/surface/surface.h"
#include "server/session/measurements/measurement_set.h"
#include "server/touch/plan.h"

namespace touchstone::diagnosis::distributions {

// The touches of one object in a set without poses.
struct PoseFreeObject {
  std::shared_ptr<const geometry::Surface> surface;
  std::vector<int> rows;         // of the set, in its order; thinned in large sets
  std::vector<uint64_t> number;  // [index into rows]: which touch of the assumed plan the row was
  touch::Plan plan;              // faces
  int repeats = 1;               // touches per pose, as the times show
  bool in_rounds = false;        // repeats stand a constant number of rows apart
};

// How the poses were probably spread: what a set without poses does not record. By default as the faces plan
// does.
struct AssumedPoses {
  double max_tilt_rad = touch::FacesPlan().max_tilt_rad;
  double spread = touch::FacesPlan().spread;  // over the face, 0 to 1
};
touch::Plan WithPoses(const touch::Plan& plan, const AssumedPoses& poses);

// How many touches of every pose the times show: 1 unless every touch has that many very close companions.
// `time_s`: [touch * fingers + finger]. `in_rounds` is set to whether the set visits all poses again and
// again.
int CountRepeats(const std::vector<double>& time_s, int fingers, bool* in_rounds);

// Object `object` of a set, with at most `max_touches` of its touches: whole poses.
PoseFreeObject AssumePlan(const session::MeasurementSet& set, int object,
                          std::shared_ptr<const geometry::Surface> surface, double speed_m_s,
                          int max_touches);

// Scatter of one finger's time among the rounds of a pose, pooled over objects; all 0 if there are no rounds.
struct RoundScatter {
  double sigma_s = 0;
  double degrees_of_freedom = 0;
};
RoundScatter ScatterAmongRounds(const session::MeasurementSet& set,
                                const std::vector<PoseFreeObject>& objects);

}  // namespace touchstone::diagnosis::distributions
