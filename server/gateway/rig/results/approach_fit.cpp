#include "server/gateway/rig/results/approach_fit.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/status.h"

namespace touchstone::gateway {
namespace {

constexpr double kOutlier = 6;            // standard deviations, from the median deviation
constexpr double kMinDeviationM = 1e-10;  // states without any noise
constexpr int kFewestWithOutliers = 12;   // states among which an outlier can be told
constexpr double kDisagree = 3;           // standard errors between ramp and level part
constexpr double kSpeedSure = 4;          // standard errors

// By how much the 4-sigma quantile of Student's t is wider than the normal one, within 3 % from 4 degrees of freedom on:
// 3.26 at 4, 1.55 at 10, 1.24 at 20, 1.04 at 100.
double Widening(double freedom) {
  return 1 + 4 / freedom + 20 / (freedom * freedom);
}

double MedianOf(std::vector<double> values) {
  const size_t middle = values.size() / 2;
  std::nth_element(values.begin(), values.begin() + middle, values.end());
  return values[middle];
}

// Standard deviation of residuals that may have outliers; of a few residuals as much as can be, so that all are kept.
double RobustDeviation(const std::vector<double>& residuals) {
  std::vector<double> sizes;
  for (const double r : residuals) sizes.push_back(std::abs(r));
  if (sizes.size() < kFewestWithOutliers) return std::numeric_limits<double>::max() / kOutlier;
  return std::max(1.4826 * MedianOf(std::move(sizes)), kMinDeviationM);
}

// By how much the variance of a mean grows because neighbouring residuals are alike: 1 + 2 sum of the correlations,
// as long as pairs of them are positive (Geyer, Practical Markov chain Monte Carlo, 1992).
double CorrelationFactor(const std::vector<double>& residuals) {
  const size_t n = residuals.size();
  double zero = 0;
  for (const double r : residuals) zero += r * r;
  const auto correlation = [&](size_t lag) {
    double sum = 0;
    for (size_t i = lag; i < n; ++i) sum += residuals[i] * residuals[i - lag];
    return sum / zero;
  };
  if (!(zero > 0)) return 1;
  double sum = 1;  // of pairs: (0, 1), (2, 3) ...
  for (size_t lag = 0; lag + 1 < n / 4; lag += 2) {
    const double pair = correlation(lag) + correlation(lag + 1);
    if (pair <= 0) break;
    sum = lag == 0 ? 2 * pair - 1 : sum + 2 * pair;
  }
  return std::max(sum, 1.0);
}

// What some states say of one number: a weighted mean with its standard error.
struct Shift {
  double value = 0, variance = 0, weight = 0;
};

class Fitter {
 public:
  Fitter(const std::vector<ApproachState>& states, const ApproachProfile& profile, bool none_missing)
      : states_(states), none_missing_(none_missing), profile_(profile) {}

  absl::StatusOr<ApproachFit> Fit();

 private:
  // A first guess that outliers do not reach: the median of what each state beyond the ramp says.
  double Guess() const;
  absl::Status CheckReached() const;
  // The straight line through the level states of this start: its slope and standard error.
  void MeasureSpeed(double began_s);
  Shift MeanShift(double began_s, bool level) const;

  const std::vector<ApproachState>& states_;
  const bool none_missing_;
  ApproachProfile profile_;  // its speed the commanded one, unless another one is certain
  double deviation_m_ = 0, correlation_ = 1;
  ApproachFit fit_;
};

double Fitter::Guess() const {
  std::vector<double> begun;
  for (const ApproachState& state : states_)
    if (state.distance_m > profile_.RampM())
      begun.push_back(state.time_s - state.distance_m / profile_.speed_m_s);
  return MedianOf(std::move(begun)) - profile_.RampS() / 2;
}

absl::Status Fitter::CheckReached() const {
  int level = 0;
  double farthest_m = 0;
  for (const ApproachState& state : states_) {
    level += state.distance_m > profile_.RampM();
    farthest_m = std::max(farthest_m, state.distance_m);
  }
  if (level >= kMinApproachStates) return absl::OkStatus();
  if (none_missing_ && level > 0)
    return absl::FailedPreconditionError(
        absl::StrFormat("the approach was at its commanded speed of %.4g mm/s for only %d states of the "
                        "controller before the last "
                        "finger made contact (%d are needed), and none is missing: give the touch a lower "
                        "speed or a longer standoff",
                        1e3 * profile_.speed_m_s, level, kMinApproachStates));
  if (!none_missing_ &&
      (static_cast<int>(states_.size()) < kMinApproachStates || farthest_m > 2 * profile_.RampM()))
    return absl::UnavailableError(
        absl::StrFormat("only %d states of the approach at its full speed arrived from the controller (%d "
                        "are needed), so when it began "
                        "is not known well enough: touch again; if it stays so, look for what keeps the "
                        "network or this machine busy",
                        level, kMinApproachStates));
  return absl::FailedPreconditionError(absl::StrFormat(
      "the approach never reached its commanded speed of %.4g mm/s: that takes %.3g mm at %.4g mm/s^2, and "
      "it had come "
      "%.3g mm when the last finger made contact; give the touch a lower speed or a longer standoff",
      1e3 * profile_.speed_m_s, 1e3 * profile_.RampM(), 1e3 * profile_.acceleration_m_s2, 1e3 * farthest_m));
}

void Fitter::MeasureSpeed(double began_s) {
  std::vector<ApproachState> level;
  for (const ApproachState& state : states_)
    if (state.distance_m > profile_.RampM() && state.time_s > began_s + profile_.RampS() / 2)
      level.push_back(state);
  std::vector<double> residuals;
  double slope = 0, squares = 0;
  for (int round = 0; round < 8; ++round) {
    double time_s = 0, distance_m = 0, product = 0;
    for (const ApproachState& state : level)
      time_s += state.time_s / level.size(), distance_m += state.distance_m / level.size();
    squares = 0;
    for (const ApproachState& state : level) {
      squares += (state.time_s - time_s) * (state.time_s - time_s);
      product += (state.time_s - time_s) * (state.distance_m - distance_m);
    }
    if (!(squares > 0)) break;
    slope = product / squares;
    residuals.clear();
    for (const ApproachState& state : level)
      residuals.push_back(state.distance_m - distance_m - slope * (state.time_s - time_s));
    const double limit_m = kOutlier * RobustDeviation(residuals);
    std::vector<ApproachState> kept;
    for (size_t i = 0; i < level.size(); ++i)
      if (std::abs(residuals[i]) <= limit_m) kept.push_back(level[i]);
    if (kept.size() == level.size() || kept.size() < kMinApproachStates) break;
    level = std::move(kept);
  }
  double sum = 0;
  for (const double r : residuals) sum += r * r;
  const double freedom = std::max<double>(1, static_cast<double>(level.size()) - 2);
  fit_.speed_m_s = slope;
  fit_.speed_uncertainty_m_s =
      squares > 0 ? std::sqrt(sum / freedom / squares * CorrelationFactor(residuals)) * Widening(freedom)
                  : profile_.speed_m_s;
}

// How much later than `began_s` these states say that it began.
Shift Fitter::MeanShift(double began_s, bool level) const {
  double numerator = 0, weight = 0;
  for (const ApproachState& state : states_) {
    const double since_s = state.time_s - began_s;
    if (since_s <= 0 || (since_s >= profile_.RampS()) != level) continue;
    const double residual_m = state.distance_m - profile_.DistanceAt(since_s);
    if (deviation_m_ > 0 && std::abs(residual_m) > kOutlier * deviation_m_) continue;
    const double speed_m_s = profile_.SpeedAt(since_s);
    numerator -= residual_m * speed_m_s;
    weight += speed_m_s * speed_m_s;
  }
  if (!(weight > 0)) return {};
  return {numerator / weight, deviation_m_ * deviation_m_ * correlation_ / weight, weight};
}

absl::StatusOr<ApproachFit> Fitter::Fit() {
  TOUCHSTONE_RETURN_IF_ERROR(CheckReached());
  double began_s = Guess();
  MeasureSpeed(began_s);
  const double off_m_s = std::abs(fit_.speed_m_s - profile_.speed_m_s);
  if (off_m_s > kMaxSpeedDeviation * profile_.speed_m_s && off_m_s > kSpeedSure * fit_.speed_uncertainty_m_s)
    return absl::FailedPreconditionError(
        absl::StrFormat("the arm's poses show %.4g mm/s during the approach, and %.4g mm/s were commanded: "
                        "contact times at another speed "
                        "cannot be compared with others; set the speed slider to 100 %%, see whether a "
                        "safety limit or a heavy load slows "
                        "the arm, and touch again",
                        1e3 * fit_.speed_m_s, 1e3 * profile_.speed_m_s));

  // A little off, and certain: then it went at the measured speed, which is known worse than the commanded one.
  const bool slope_is_free = off_m_s > kSpeedSure * fit_.speed_uncertainty_m_s;
  if (slope_is_free) {
    profile_.speed_m_s = fit_.speed_m_s;
    began_s = Guess();
  }

  // The level part alone, with its residuals; then the ramp too, if the arm made it as commanded.
  std::vector<double> residuals;
  for (int round = 0; round < 20; ++round) {
    residuals.clear();
    for (const ApproachState& state : states_)
      if (state.time_s - began_s >= profile_.RampS())
        residuals.push_back(state.distance_m - profile_.DistanceAt(state.time_s - began_s));
    if (residuals.size() < kMinApproachStates) break;
    deviation_m_ = RobustDeviation(residuals);
    const Shift shift = MeanShift(began_s, true);
    began_s += shift.value;
    if (std::abs(shift.value) < 1e-10) break;
  }
  residuals.erase(std::remove_if(residuals.begin(), residuals.end(),
                                 [&](double r) { return std::abs(r) > kOutlier * deviation_m_; }),
                  residuals.end());
  const double freedom = static_cast<double>(residuals.size()) - 1;
  if (freedom + 1 < kMinApproachStates)
    return absl::UnavailableError(absl::StrCat(
        "only ", residuals.size(),
        " states of the approach agree with its commanded course, so when it began is not known well "
        "enough: touch again"));
  double sum = 0;
  for (const double r : residuals) sum += r * r;
  deviation_m_ = std::max(std::sqrt(sum / freedom), kMinDeviationM);
  correlation_ = CorrelationFactor(residuals);
  const Shift level = MeanShift(began_s, true), ramp = MeanShift(began_s, false);
  double variance = level.variance;
  if (ramp.weight > 0 && std::abs(ramp.value) < kDisagree * std::sqrt(ramp.variance + level.variance)) {
    began_s += ramp.value * ramp.weight / (ramp.weight + level.weight);
    variance *= level.weight / (ramp.weight + level.weight);
  }
  if (slope_is_free) {
    double mean_s = 0;
    for (const ApproachState& state : states_) mean_s += (state.time_s - began_s) / states_.size();
    variance += std::pow(mean_s * fit_.speed_uncertainty_m_s / fit_.speed_m_s, 2);
  }
  fit_.began_s = began_s;
  // Residuals that are alike count as so many fewer states, and how alike they are is an estimate itself.
  fit_.began_uncertainty_s = std::sqrt(variance) * Widening(std::max(1.0, freedom / (2 * correlation_ - 1)));
  fit_.states = static_cast<int>(residuals.size());
  return fit_;
}

}  // namespace

double ApproachProfile::DistanceAt(double since_start_s) const {
  if (since_start_s <= 0) return 0;
  if (since_start_s < RampS()) return 0.5 * acceleration_m_s2 * since_start_s * since_start_s;
  return speed_m_s * (since_start_s - 0.5 * RampS());
}

double ApproachProfile::SpeedAt(double since_start_s) const {
  return std::clamp(acceleration_m_s2 * since_start_s, 0.0, speed_m_s);
}

bool NoStateIsMissing(const std::vector<ApproachState>& states, const ApproachProfile& profile) {
  if (states.size() < 3) return false;
  double shortest_s = std::numeric_limits<double>::infinity(), longest_s = 0;
  for (size_t i = 1; i < states.size(); ++i) {
    const double gap_s = states[i].time_s - states[i - 1].time_s;
    shortest_s = std::min(shortest_s, gap_s), longest_s = std::max(longest_s, gap_s);
  }
  return longest_s < 1.5 * shortest_s && states.front().distance_m <= profile.RampM();
}

absl::StatusOr<ApproachFit> FitApproach(const std::vector<ApproachState>& states,
                                        const ApproachProfile& profile, bool none_missing) {
  return Fitter(states, profile, none_missing).Fit();
}

}  // namespace touchstone::gateway
