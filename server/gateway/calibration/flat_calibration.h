// The fingers against each other: what repeated touches of a flat face, met straight on, tell of their
// lengths and of the noise of their times. And the same lengths taken out of measured times again.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/model/model.h"

namespace touchstone::gateway::calibration {

struct FlatTouch {
  double speed_m_s = 0;                // measured, or as commanded
  std::vector<double> contact_time_s;  // per finger; NaN: reported nothing
};

struct FlatCalibration {
  int fingers = 0;
  double spacing_m = 0;
  std::vector<double> offset_m;  // of every finger, as finger_length has it: longer travel is positive; sum 0
  std::vector<double> offset_std_error_m;
  double sigma_s = 0, sigma_std_error_s = 0;  // of one finger's time, as gaussian_noise has it
  double tilt_rad = 0,
         tilt_std_error_rad = 0;  // the tool_tilt that explains as much of the offsets as it can
  size_t touches = 0;             // used
  size_t left_out = 0;            // a finger reported nothing, or a time that no noise explains
  std::string note;               // for people: what these touches cannot tell, what was left out
};

inline constexpr size_t kMinFlatTouches = 3;

// INVALID_ARGUMENT: fewer than three whole touches, a finger that reports too rarely (named), a face that is
// met at more than 3 degrees, touches of another number of fingers. Touches of several speeds may be mixed.
absl::StatusOr<FlatCalibration> CalibrateFlat(const std::vector<FlatTouch>& touches, double spacing_m);

// The base model with these offsets and this noise instead of its own, as a model file. INVALID_ARGUMENT if
// it has another number of fingers.
absl::StatusOr<std::string> CalibratedModelFile(const model::Model& base, const FlatCalibration& calibration,
                                                const model::EffectCatalogue& catalogue);

// Contact times as fingers of equal length would have had them, less the earliest: the descriptor.
// NaN stays NaN.
std::vector<double> CorrectedTimes(const FlatTouch& touch, const FlatCalibration& calibration);

// A number and its standard error.
struct Uncertain {
  double value = 0;
  double std_error = 0;
};

// Time, distance and speed in terms of each other; errors are taken as independent, to first order.
Uncertain TimeOf(const Uncertain& distance_m, const Uncertain& speed_m_s);
Uncertain DistanceOf(const Uncertain& time_s, const Uncertain& speed_m_s);
Uncertain SpeedOf(const Uncertain& distance_m, const Uncertain& time_s);

}  // namespace touchstone::gateway::calibration
