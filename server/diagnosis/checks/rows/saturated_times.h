// Times that are cut off: a counter that stops, a time-out, or a file in which the largest values were clipped.
#pragma once

#include <vector>

#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::checks {

struct SaturatedTimes {
  double time_s = 0;         // the largest, since the touch's first contact
  std::vector<int> fingers;  // whose largest it is; empty: no time is cut off
  int touches = 0;           // in which one of them has it
  int example = -1;          // row of the first
  // [row * fingers + finger] of the set: the readings that are cut off.
  std::vector<size_t> readings;
};

// A finger's times are cut off where far more touches share its largest time than share any of the next ones below, and the
// model expects nearly all of them later than that, by amounts that differ. Ticks give every time its share of touches, and
// as many are expected before the largest as after it; repeats and copies share what is expected; contacts that were missed
// have no time. Fingers that are cut off at different times are told by the one with more touches.
SaturatedTimes FindSaturatedTimes(const touches::Observations& observations,
                                  const touches::Prediction& expected);

}  // namespace touchstone::diagnosis::checks
