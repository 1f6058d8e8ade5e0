#include "server/gateway/calibration/flat_calibration.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/text/file_number.h"
#include "server/base/text/text.h"
#include "server/model/parameter_values.h"

namespace touchstone::gateway::calibration {
namespace {

constexpr double kMaxTiltRad = 3 * kRadiansPerDegree;
constexpr double kMinReported = 0.8;   // of the touches, by every finger
constexpr double kSignificant = 4;     // standard errors
constexpr double kFlatOutlier = 6;     // robust standard deviations
constexpr size_t kMinForOutliers = 8;  // below, a spread cannot be estimated robustly

// A touch's times less their mean: what an unknown start leaves.
std::vector<double> Centred(const FlatTouch& touch) {
  std::vector<double> centred = touch.contact_time_s;
  double mean_s = 0;
  for (const double time_s : centred) mean_s += time_s / static_cast<double>(centred.size());
  for (double& time_s : centred) time_s -= mean_s;
  return centred;
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

// Offsets by least squares: centred time = offset / speed + noise.
std::vector<double> Offsets(const std::vector<FlatTouch>& touches, double* weight) {
  std::vector<double> offset_m(touches[0].contact_time_s.size());
  *weight = 0;
  for (const FlatTouch& touch : touches) {
    const std::vector<double> centred_s = Centred(touch);
    for (size_t i = 0; i < offset_m.size(); ++i) offset_m[i] += centred_s[i] / touch.speed_m_s;
    *weight += 1 / (touch.speed_m_s * touch.speed_m_s);
  }
  for (double& offset : offset_m) offset /= *weight;
  return offset_m;
}

// The touches without those that lie far from the median of all, finger by finger.
std::vector<FlatTouch> WithoutOutliers(const std::vector<FlatTouch>& touches) {
  if (touches.size() < kMinForOutliers) return touches;
  std::vector<bool> keep(touches.size(), true);
  for (size_t i = 0; i < touches[0].contact_time_s.size(); ++i) {
    std::vector<double> distance_m;
    for (const FlatTouch& touch : touches) distance_m.push_back(Centred(touch)[i] * touch.speed_m_s);
    const double median_m = Median(distance_m);
    std::vector<double> off_m = distance_m;
    for (double& off : off_m) off = std::abs(off - median_m);
    const double spread_m = 1.4826 * Median(off_m);
    for (size_t k = 0; k < touches.size(); ++k)
      if (spread_m > 0 && off_m[k] > kFlatOutlier * spread_m) keep[k] = false;
  }
  std::vector<FlatTouch> kept;
  for (size_t k = 0; k < touches.size(); ++k)
    if (keep[k]) kept.push_back(touches[k]);
  return kept;
}

// The touches in which every finger reported; an error names what is wrong with the others.
absl::StatusOr<std::vector<FlatTouch>> Whole(const std::vector<FlatTouch>& touches, size_t fingers) {
  std::vector<size_t> reported(fingers);
  std::vector<FlatTouch> whole;
  for (size_t k = 0; k < touches.size(); ++k) {
    const FlatTouch& touch = touches[k];
    if (touch.contact_time_s.size() != fingers)
      return absl::InvalidArgumentError(absl::StrCat("flat touch ", k, " has ", touch.contact_time_s.size(),
                                                     " fingers, the first has ", fingers));
    if (!(touch.speed_m_s > 0) || !std::isfinite(touch.speed_m_s))
      return absl::InvalidArgumentError(absl::StrCat(
          "flat touch ", k, " has speed ", ShortestNumber(touch.speed_m_s), " m/s; one above 0 is needed"));
    bool all = true;
    for (size_t i = 0; i < fingers; ++i) {
      if (std::isfinite(touch.contact_time_s[i]))
        ++reported[i];
      else
        all = false;
    }
    if (all) whole.push_back(touch);
  }
  for (size_t i = 0; i < fingers; ++i)
    if (static_cast<double>(reported[i]) < kMinReported * static_cast<double>(touches.size()))
      return absl::InvalidArgumentError(absl::StrCat(
          "finger ", i, " (of 0 to ", fingers - 1, ") reported in ", reported[i], " of ", touches.size(),
          " flat touches; repair its sensor, or place the face so that every finger meets it"));
  return whole;
}

}  // namespace

absl::StatusOr<FlatCalibration> CalibrateFlat(const std::vector<FlatTouch>& given, double spacing_m) {
  if (given.size() < kMinFlatTouches)
    return absl::InvalidArgumentError(absl::StrCat("the flat calibration has ", given.size(),
                                                   " touches; at least ", kMinFlatTouches,
                                                   " are needed, 20 are good"));
  const size_t fingers = given[0].contact_time_s.size();
  if (fingers < 2)
    return absl::InvalidArgumentError("a flat calibration compares fingers; at least 2 are needed");
  if (!(spacing_m > 0))
    return absl::InvalidArgumentError(
        absl::StrCat("the fingers' spacing is ", spacing_m, " m; one above 0 is needed"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<FlatTouch> whole, Whole(given, fingers));
  const std::vector<FlatTouch> touches = WithoutOutliers(whole);
  if (touches.size() < kMinFlatTouches)
    return absl::InvalidArgumentError(absl::StrCat("in ", touches.size(), " of ", given.size(),
                                                   " flat touches every finger reported; at least ",
                                                   kMinFlatTouches, " such touches are needed"));
  FlatCalibration flat;
  flat.fingers = static_cast<int>(fingers);
  flat.spacing_m = spacing_m;
  flat.touches = touches.size();
  flat.left_out = given.size() - touches.size();
  double weight = 0;
  flat.offset_m = Offsets(touches, &weight);

  double squares = 0;
  for (const FlatTouch& touch : touches) {
    const std::vector<double> centred_s = Centred(touch);
    for (size_t i = 0; i < fingers; ++i) {
      const double rest_s = centred_s[i] - flat.offset_m[i] / touch.speed_m_s;
      squares += rest_s * rest_s;
    }
  }
  const double freedom = static_cast<double>((fingers - 1) * (touches.size() - 1));
  flat.sigma_s = std::sqrt(squares / freedom);
  flat.sigma_std_error_s = flat.sigma_s / std::sqrt(2 * freedom);
  const double n = static_cast<double>(fingers);
  flat.offset_std_error_m.assign(fingers, flat.sigma_s * std::sqrt((1 - 1 / n) / weight));

  // The straight line through the offsets.
  double along = 0, across = 0;
  for (size_t i = 0; i < fingers; ++i) {
    const double x_m = (static_cast<double>(i) - (n - 1) / 2) * spacing_m;
    along += x_m * flat.offset_m[i];
    across += x_m * x_m;
  }
  const double slope = along / across;
  flat.tilt_rad = std::atan(slope);
  flat.tilt_std_error_rad = flat.sigma_s / std::sqrt(weight * across) / (1 + slope * slope);
  const double tilt_deg = flat.tilt_rad / kRadiansPerDegree;
  if (std::abs(flat.tilt_rad) > kMaxTiltRad)
    return absl::InvalidArgumentError(
        absl::StrFormat("the face is met at %.1f degrees across the fingers; place it straight on (3 degrees "
                        "at most) and touch again",
                        tilt_deg));
  std::vector<std::string> notes;
  if (std::abs(flat.tilt_rad) > kSignificant * flat.tilt_std_error_rad)
    notes.push_back(absl::StrFormat(
        "a tool or face that is tilted by %.3f +- %.3f deg (tool_tilt) explains the linear part of the "
        "offsets as well: "
        "turn the tool by 180 deg about the approach and touch again, what changes its sign is the face's",
        tilt_deg, flat.tilt_std_error_rad / kRadiansPerDegree));
  if (flat.left_out > 0)
    notes.push_back(absl::StrCat(flat.left_out, " of ", given.size(),
                                 " touches left out: a finger reported nothing, or far from all others"));
  flat.note = absl::StrJoin(notes, "; ");
  return flat;
}

absl::StatusOr<std::string> CalibratedModelFile(const model::Model& base, const FlatCalibration& flat,
                                                const model::EffectCatalogue& catalogue) {
  if (base.fingers != flat.fingers)
    return absl::InvalidArgumentError(absl::StrCat("the base model has ", base.fingers,
                                                   " fingers, the calibration ", flat.fingers,
                                                   "; give a model of the same end effector"));
  model::Model model = base;
  model.spacing_m = flat.spacing_m;
  const auto replaced = [](const model::EffectInstance& instance) {
    return instance.effect->name == "finger_length" || instance.effect->name == "gaussian_noise";
  };
  model.effects.erase(std::remove_if(model.effects.begin(), model.effects.end(), replaced),
                      model.effects.end());
  std::vector<std::string> offsets;
  for (const double offset_m : flat.offset_m) offsets.push_back(FileNumber(Unit::kMillimetre, offset_m));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      model, model::AddEffect(model, "finger_length",
                              {absl::StrCat("offset_mm=", absl::StrJoin(offsets, ","))}, catalogue));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      model,
      model::AddEffect(model, "gaussian_noise",
                       {absl::StrCat("sigma_us=", FileNumber(Unit::kMicrosecond, flat.sigma_s))}, catalogue));
  return model::FormatModel(model);
}

std::vector<double> CorrectedTimes(const FlatTouch& touch, const FlatCalibration& calibration) {
  std::vector<double> times_s = touch.contact_time_s;
  double earliest_s = HUGE_VAL;
  for (size_t i = 0; i < times_s.size() && i < calibration.offset_m.size(); ++i) {
    times_s[i] -= calibration.offset_m[i] / touch.speed_m_s;
    if (times_s[i] < earliest_s) earliest_s = times_s[i];
  }
  for (double& time_s : times_s) time_s -= earliest_s;
  return times_s;
}

Uncertain TimeOf(const Uncertain& distance_m, const Uncertain& speed_m_s) {
  const double time_s = distance_m.value / speed_m_s.value;
  return {time_s, std::hypot(distance_m.std_error, time_s * speed_m_s.std_error) / std::abs(speed_m_s.value)};
}

Uncertain DistanceOf(const Uncertain& time_s, const Uncertain& speed_m_s) {
  return {time_s.value * speed_m_s.value,
          std::hypot(time_s.value * speed_m_s.std_error, speed_m_s.value * time_s.std_error)};
}

Uncertain SpeedOf(const Uncertain& distance_m, const Uncertain& time_s) {
  return TimeOf(distance_m, time_s);  // the same quotient
}

}  // namespace touchstone::gateway::calibration
