// Times that a polling loop reads differ by whole multiples of its interval, the tick.
#pragma once

#include <vector>

#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::touches {

// The tick that `differences` of times (s, sorted) lie on, near `interval_s`; 0 if they lie on none.
double RefinedTick(const std::vector<double>& differences, double interval_s);

// The same without a guess: from the smallest step between different values.
double FindTick(const std::vector<double>& differences);

// A tick that times of a part of the touches lie on, or of all.
struct TouchTicks {
  double interval_s = 0;  // 0: none
  int touches = 0;        // that lie on it
  int compared = 0;       // touches with two contacts that are not at once

  // Some are read in ticks and others are not.
  bool in_part() const { return interval_s > 0 && touches < 0.99 * compared; }
};
TouchTicks FindTouchTicks(const Observations& observations);

// The tick of one finger, on which its times lie and those of no other do: as the set has them, without those that are 0.
struct FingerTicks {
  int finger = 0;
  double interval_s = 0;  // 0: none
  int times = 0;          // that lie on it
};
FingerTicks FindFingerTicks(const Observations& observations);

// Whether every contact of a row of the set lies on the tick, counted from the first.
bool LiesOnTick(const session::MeasurementSet& set, int row, double interval_s);

}  // namespace touchstone::diagnosis::touches
