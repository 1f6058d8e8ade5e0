// Simple courses in time, each with few values: one step of the fingers ("from touch 480 on"), an offset in one stretch of
// the session, a warm-up that levels off, a wave. They are to the smooth curves of nameless_curve.h what a formula is to a
// lookup: where one of them is true, its evidence is far above a curve's, and so it is the competitor that a weak drift or
// a weak constant must beat.
#pragma once

#include <cmath>
#include <vector>

#include "server/diagnosis/selection/curves/nameless_curve.h"

namespace touchstone::diagnosis::selection {

// The best course of each kind over `fit`, as curves per finger in travel over `covariate` (one of time). A course's gain
// is averaged over all places it might have had, and over which finger it is: choosing them is paid for. Held-out errors
// are those of the course that fits best.
struct TimeCourses {
  std::vector<NamelessCurve> curves;
  // Of a constant and of a straight line of one finger: what a named effect of the catalogue says in fewer values.
  double one_finger_constant_nats = -INFINITY, one_finger_line_nats = -INFINITY;
};
TimeCourses ScoreTimeCourses(const engine::Experiment& experiment,
                             const touches::TouchObservationModel& touches, const engine::Fit& fit,
                             const touches::Prediction& details, const CurveCovariate& covariate);

}  // namespace touchstone::diagnosis::selection
