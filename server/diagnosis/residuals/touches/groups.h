// Errors by object, face, finger, round, time and speed.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::residuals {

// What the touches of a group have in common. kFinger groups hold one finger of every touch, kTime groups
// equal parts of the session.
enum class ErrorGroupKind { kObject, kFace, kFinger, kRound, kTime, kSpeed };

struct ErrorGroup {
  ErrorGroupKind kind = ErrorGroupKind::kObject;
  std::string name;  // "lat20", "3", "l", "0 to 12 min", "20 mm/s"
  int touches = 0;
  double rmse_s = 0;                 // comparable with the whole set's
  double mean_residual_s = 0;        // over the group's fingers; measured minus simulated
  double share_of_excess_error = 0;  // of the whole set's excess error over noise, 0 to 1
};

struct GroupedErrors {
  std::vector<ErrorGroup> groups;     // kind by kind; a kind with more than 200 groups is left out
  std::vector<double> finger_bias_s;  // [finger], mean residual; 0 for a finger that never took part
};

// residuals: [k * fingers + finger], seconds, NaN where a finger takes no part; sigma_s: noise of one
// finger's time. Touches that are left out, or in which fewer than two fingers are compared, count nowhere.
GroupedErrors GroupErrors(const touches::Observations& observations, const std::vector<double>& residuals,
                          double sigma_s);

}  // namespace touchstone::diagnosis::residuals
