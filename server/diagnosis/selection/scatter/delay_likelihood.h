// Likelihood of readings that come late by a random delay beside normal noise. The readings of a touch are known up to a common
// shift only, as in touches/noise/noise_likelihood.h.
#pragma once

#include <vector>

#include "server/diagnosis/touches/noise/noise_likelihood.h"

namespace touchstone::diagnosis::selection {

enum class DelayShape {
  kTwoValues,  // `share` of the readings are late by `size`
  kUniform,    // between 0 and `size`
  kLate,       // exponentially distributed, `size` on average
  kEarly,      // the same, of readings that come early
};

struct DelayedNoise {
  DelayShape shape = DelayShape::kTwoValues;
  int finger = -1;         // whose readings; -1: of all
  bool of_length = false;  // the delay of a touch is `size` times its slowness
  double size = 0;         // s
  double share = 0;        // of two values: 0 to 1
  double sigma_s = 0;      // of the normal noise
};

constexpr int kMaxDelayedFingers = 5;  // of one touch

struct TwoValues {
  DelayedNoise noise;
  double gain_nats = 0;                    // log likelihood over that of no delays
  double late_readings = 0, readings = 0;  // expected; of all that may be late
  double degrees_of_freedom = 0;
};

// Maximum likelihood of two values. `scales`: of the readings, relative to sigma; `groups`: of three readings to
// kMaxDelayedFingers.
TwoValues FitTwoValues(const std::vector<touches::ReadingGroup>& groups, const touches::NoiseModel& scales,
                       int finger, bool of_length);

double DelayedLogLikelihood(const std::vector<touches::ReadingGroup>& groups,
                            const touches::NoiseModel& scales, const DelayedNoise& noise);

// The best of another shape that has the variance of these two values; sets its log likelihood.
DelayedNoise FitShape(const std::vector<touches::ReadingGroup>& groups, const touches::NoiseModel& scales,
                      DelayShape shape, const DelayedNoise& two_values, double* log_likelihood);

}  // namespace touchstone::diagnosis::selection
