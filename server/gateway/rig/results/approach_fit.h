// When a straight approach began and how fast it was, from recorded states. Pure functions.
//
// What is known of an approach: from rest, the commanded acceleration up to the commanded speed, then that speed. The
// controller makes it in its own time and tells its states in the same time, so the profile has one unknown, its start;
// a slope that is fitted too would be extrapolated over the whole way, and states of its last tenth would then tell the
// start forty times worse. The measured speed is still estimated, as a check of what is assumed.
//
// Contacts happen where the arm is, not where it was told to be. A joint follows its target by some milliseconds, and
// behind constant speed a lag is a shift in time: the start that makes distance = profile(time) for the actual poses
// has that shift in it, as the contacts have.
#pragma once

#include <vector>

#include <absl/status/statusor.h>

namespace touchstone::gateway {

// From rest at 0 with constant acceleration to `speed_m_s`, both above 0.
struct ApproachProfile {
  double speed_m_s = 0, acceleration_m_s2 = 0;
  double RampS() const { return speed_m_s / acceleration_m_s2; }
  double RampM() const { return speed_m_s * RampS() / 2; }
  double DistanceAt(double since_start_s) const;  // 0 before the start
  double SpeedAt(double since_start_s) const;
};

// One state: any clock's time, and how far the tip had come along the approach, from its start.
struct ApproachState {
  double time_s = 0, distance_m = 0;
};

struct ApproachFit {
  double began_s = 0;  // on the states' clock
  double began_uncertainty_s =
      0;                 // standard; widened for few states, so that 4 of it hold as they would for many
  double speed_m_s = 0;  // measured, at constant speed
  double speed_uncertainty_m_s = 0;
  int states = 0;  // that were used
};

inline constexpr int kMinApproachStates = 5;
// Share by which the measured speed may differ from the commanded one: 1 % of 60 mm at 20 mm/s are 30 ms.
inline constexpr double kMaxSpeedDeviation = 0.01;

// Whether the controller's states of an approach, its braking included, came without a gap from before its full speed on.
bool NoStateIsMissing(const std::vector<ApproachState>& states, const ApproachProfile& profile);

// From the states of an approach in the order of their times, none of its braking. Outliers are left out.
// UNAVAILABLE: too few states arrived, the touch may be made again. FAILED_PRECONDITION: it was not made at the
// commanded speed, or, with none of its states missing, was at it too briefly; says what to do.
absl::StatusOr<ApproachFit> FitApproach(const std::vector<ApproachState>& states,
                                        const ApproachProfile& profile, bool none_missing = false);

}  // namespace touchstone::gateway
