// A touch as it is commanded (defined in proto/README.md), checked and made exact.
#pragma once

#include <map>
#include <string>

#include <absl/status/status.h>
#include <Eigen/Core>

namespace touchstone::touch {

// Where and how the end effector approaches. Object frame, metres.
struct TouchPose {
  Eigen::Vector3d target_m = Eigen::Vector3d::Zero();    // T, of the middle of the fingers
  Eigen::Vector3d approach = -Eigen::Vector3d::UnitZ();  // a: unit, direction of motion
  Eigen::Vector3d lateral = Eigen::Vector3d::UnitX();    // s: unit, perpendicular to a, first finger to last
  double standoff_m = 0.06;                              // from the start to T along a
  bool meets_surface = true;  // of a plan that puts T on the surface: false where nothing stands on its line
};

inline constexpr double kNoStrokeLimitM = 1e3;
inline constexpr double kDefaultSpeedMS = 0.020;

struct CommandedTouch : TouchPose {
  double speed_m_s = kDefaultSpeedMS;
  double stroke_m = kNoStrokeLimitM;  // the approach gives up after this travel
  double session_time_s = 0;
  std::map<std::string, double> covariates;  // names begin with "cov_"
};

// Checks every field and makes the vectors exactly unit and perpendicular (base/touch_limits.h). Errors begin
// with `where` ("touches[3]") and name field, value and what would be right.
absl::Status MakeExact(CommandedTouch* touch, const std::string& where);

}  // namespace touchstone::touch
