#include "server/gateway/arm/motion_limits.h"

#include <absl/strings/str_cat.h>

#include <cmath>
#include <string>
#include <utility>

#include "server/base/text.h"

namespace touchstone::gateway::arm {
namespace {

constexpr double kMaxCogM = 0.5;     // payload diagrams of the arms end before
constexpr double kMaxTiltRad = 1.4;  // a start must lie below the clearance plane's point of entry

absl::Status Invalid(const std::string& what, double value, const std::string& right) {
  return absl::InvalidArgumentError(
      absl::StrCat("limits: ", what, " = ", ShortestNumber(value), ": must be ", right));
}

}  // namespace

absl::Status CheckMotionLimits(const MotionLimits& limits) {
  for (const auto& [what, value] : {std::pair<const char*, double>{"max_speed_m_s", limits.max_speed_m_s},
                                    {"transit_speed_m_s", limits.transit_speed_m_s},
                                    {"acceleration_m_s2", limits.acceleration_m_s2},
                                    {"max_standoff_m", limits.max_standoff_m},
                                    {"stroke_beyond_target_m", limits.stroke_beyond_target_m},
                                    {"clearance_m", limits.clearance_m}})
    if (!(value > 0) || !(value <= 10)) return Invalid(what, value, "above 0 and at most 10");
  if (!(limits.max_tilt_rad >= 0) || !(limits.max_tilt_rad <= kMaxTiltRad))
    return Invalid("max_tilt_rad", limits.max_tilt_rad, "from 0 to 1.4");
  if (!(limits.outermost_finger_m >= 0) || !(limits.outermost_finger_m <= 0.5))
    return Invalid("outermost_finger_m", limits.outermost_finger_m, "from 0 to 0.5");
  if (!(limits.payload_kg >= 0) || !(limits.payload_kg <= limits.max_payload_kg))
    return Invalid("payload_kg", limits.payload_kg,
                   absl::StrCat("from 0 to max_payload_kg = ", ShortestNumber(limits.max_payload_kg)));
  if (limits.payload_cog_m.has_value())
    for (int axis = 0; axis < 3; ++axis)
      if (!(std::abs((*limits.payload_cog_m)[axis]) <= kMaxCogM))
        return Invalid(absl::StrCat("payload_cog_m[", axis, "]"), (*limits.payload_cog_m)[axis],
                       "within 0.5 m of the flange");
  for (int axis = 0; axis < 3; ++axis)
    if (!(limits.box_min_m[axis] < limits.box_max_m[axis]))
      return Invalid(absl::StrCat("box_min_m[", axis, "]"), limits.box_min_m[axis], "below box_max_m");
  for (size_t i = 0; i < 6; ++i) {
    if (!(limits.joint_min_rad[i] < limits.joint_max_rad[i]))
      return Invalid(absl::StrCat("joint_min_rad[", i, "]"), limits.joint_min_rad[i], "below joint_max_rad");
    if (!(limits.home_rad[i] >= limits.joint_min_rad[i]) || !(limits.home_rad[i] <= limits.joint_max_rad[i]))
      return Invalid(absl::StrCat("home_rad[", i, "]"), limits.home_rad[i], "within the joint's limits");
  }
  return absl::OkStatus();
}

}  // namespace touchstone::gateway::arm
