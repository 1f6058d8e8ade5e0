// Whether the object moves steadily while it is touched: it creeps, or what holds it gives way. Its mean looks like a pose
// that was registered wrongly and its course like noise that grows on slopes, and it is neither.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::selection {

struct MovingObject {
  double p = 1;           // of so large a gain by chance (F test, all that was tried)
  double gain_nats = 0;   // of a steady motion over none (BIC)
  double moved_m = 0;     // from an object's first touch to its last, the mean over objects; 0: it turns
  double turned_rad = 0;  // likewise; 0: it does not turn
  std::string words;      // sentences for people
};

// `details` and `residuals` [k * fingers + i] of one model. A motion is compared with none and with a pose of the object's own in
// every round, poses of each object and a drift of each finger beside all of them. Repeats are compared with one another, which no misfit touches; without
// repeats nothing is said where the order of the touches goes with their poses. Nothing where a steady motion is not ahead.
std::optional<MovingObject> FindMovingObject(const touches::Observations& observations,
                                             const touches::Prediction& details,
                                             const std::vector<double>& residuals);

// Puts the session's time in front of the covariates.
void NameMotionFirst(const touches::Observations& observations, const MovingObject& moving,
                     engine::UnexplainedRest* rest);

}  // namespace touchstone::diagnosis::selection
