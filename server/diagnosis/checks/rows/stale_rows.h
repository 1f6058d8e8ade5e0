// Rows that hold the times of the row before: the reading was not renewed.
#pragma once

#include "server/session/measurements/measurement_set.h"

namespace touchstone::diagnosis::checks {

struct StaleRows {
  int rows = 0;
  double expected = 0;  // that repeat a row some way before, which is chance
  int example = -1;     // the first of them
};

// Zero rows unless there are far more than chance gives: touches of a coarse clock, or of one pose in a row, are alike
// without being stale.
StaleRows FindStaleRows(const session::MeasurementSet& set);

}  // namespace touchstone::diagnosis::checks
