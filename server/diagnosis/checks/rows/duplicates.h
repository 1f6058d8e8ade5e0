// Rows that repeat an earlier row digit for digit under another touch number.
#pragma once

#include "server/diagnosis/touches/observations.h"
#include "server/model/model.h"

namespace touchstone::diagnosis::checks {

struct Duplicates {
  int rows = 0;  // copies, each beyond the first of its kind
  double expected =
      0;  // pairs of repeats that agree by chance, given the scatter and the resolution of the times
  int example = -1;  // row of the first copy
};

// No rig repeats a touch to the last digit; a clock of coarse ticks does. Zero rows unless there are far more copies
// than chance gives, and enough to matter: copies taken for repeats make the noise floor too low and every misfit
// that repeats too certain. Copies that lie on a tick of the sensor,
// which may hold for a part of the touches, are expected with it. A model without noise expects equal repeats, and then only equal session times count.
Duplicates FindDuplicates(const touches::Observations& observations, const model::Model& model);

}  // namespace touchstone::diagnosis::checks
