#include "server/gateway/arm/kinematics/motion_limits.h"

#include <absl/strings/str_cat.h>

#include <cmath>
#include <string>

#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::gateway::arm {
namespace {

constexpr double kMaxCogM = 0.5;     // payload diagrams of the arms end before
constexpr double kMaxTiltRad = 1.4;  // a start must lie below the clearance plane's point of entry

absl::Status Invalid(const std::string& what, double value, const std::string& right) {
  return absl::InvalidArgumentError(
      absl::StrCat("limits: ", what, " = ", ShortestNumber(value), ": must be ", right));
}

// A number between bounds, both in its own unit.
absl::Status CheckBetween(const char* what, double value, double min, double max) {
  if (value >= min && value <= max) return absl::OkStatus();
  return Invalid(what, value, absl::StrCat("from ", ShortestNumber(min), " to ", ShortestNumber(max)));
}

absl::Status CheckJoints(const MotionLimits& limits, const ArmModel& model) {
  constexpr double kToleranceRad = 1e-3;  // of what people round
  for (size_t i = 0; i < 6; ++i) {
    const double most = model.max_joint_rad[i];
    if (!(limits.joint_min_rad[i] < limits.joint_max_rad[i]))
      return Invalid(absl::StrCat("joint_min_rad[", i, "]"), limits.joint_min_rad[i], "below joint_max_rad");
    if (!(limits.joint_min_rad[i] >= -most - kToleranceRad) ||
        !(limits.joint_max_rad[i] <= most + kToleranceRad))
      return Invalid(absl::StrCat("joint_min_rad[", i, "] or joint_max_rad[", i, "]"),
                     limits.joint_min_rad[i] < -most ? limits.joint_min_rad[i] : limits.joint_max_rad[i],
                     absl::StrCat("within ", ShortestNumber(most), ", what a ", model.name, " can turn"));
    if (!(limits.home_rad[i] >= limits.joint_min_rad[i]) || !(limits.home_rad[i] <= limits.joint_max_rad[i]))
      return Invalid(absl::StrCat("home_rad[", i, "]"), limits.home_rad[i], "within the joint's limits");
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckMotionLimits(const MotionLimits& limits, const ArmModel& model) {
  constexpr double kMinSpeedMS = 1e-6, kMinTransitMS = 1e-3, kMinLengthM = 1e-3, kMaxLimit = 10;
  TOUCHSTONE_RETURN_IF_ERROR(CheckBetween("min_speed_m_s", limits.min_speed_m_s, kMinSpeedMS, kMaxLimit));
  TOUCHSTONE_RETURN_IF_ERROR(
      CheckBetween("max_speed_m_s", limits.max_speed_m_s, limits.min_speed_m_s, kMaxLimit));
  TOUCHSTONE_RETURN_IF_ERROR(
      CheckBetween("transit_speed_m_s", limits.transit_speed_m_s, kMinTransitMS, kMaxLimit));
  TOUCHSTONE_RETURN_IF_ERROR(
      CheckBetween("max_arm_speed_m_s", limits.max_arm_speed_m_s, kMinTransitMS, kMaxLimit));
  TOUCHSTONE_RETURN_IF_ERROR(CheckBetween("acceleration_m_s2", limits.acceleration_m_s2, 1e-2, kMaxLimit));
  TOUCHSTONE_RETURN_IF_ERROR(CheckBetween("max_standoff_m", limits.max_standoff_m, kMinLengthM, kMaxLimit));
  TOUCHSTONE_RETURN_IF_ERROR(
      CheckBetween("stroke_beyond_target_m", limits.stroke_beyond_target_m, 1e-4, kMaxLimit));
  TOUCHSTONE_RETURN_IF_ERROR(CheckBetween("clearance_m", limits.clearance_m, kMinLengthM, kMaxLimit));
  TOUCHSTONE_RETURN_IF_ERROR(CheckBetween("arm_margin_m", limits.arm_margin_m, 0, 0.5));
  // Twice its error would trip it; beyond its range nothing is measured.
  TOUCHSTONE_RETURN_IF_ERROR(
      CheckBetween("max_force_n", limits.max_force_n, 2 * model.force_accuracy_n, model.force_range_n));
  if (!(limits.max_tilt_rad >= 0) || !(limits.max_tilt_rad <= kMaxTiltRad))
    return Invalid("max_tilt_rad", limits.max_tilt_rad, "from 0 to 1.4");
  if (!(limits.outermost_finger_m >= 0) || !(limits.outermost_finger_m <= 0.5))
    return Invalid("outermost_finger_m", limits.outermost_finger_m, "from 0 to 0.5");
  if (!(limits.payload_kg >= 0) || !(limits.payload_kg <= model.max_payload_kg))
    return Invalid("payload_kg", limits.payload_kg,
                   absl::StrCat("from 0 to ", ShortestNumber(model.max_payload_kg), ", what a ", model.name,
                                " carries"));
  if (limits.payload_cog_m.has_value())
    for (int axis = 0; axis < 3; ++axis)
      if (!(std::abs((*limits.payload_cog_m)[axis]) <= kMaxCogM))
        return Invalid(absl::StrCat("payload_cog_m[", axis, "]"), (*limits.payload_cog_m)[axis],
                       "within 0.5 m of the flange");
  for (int axis = 0; axis < 3; ++axis)
    if (!(limits.box_min_m[axis] < limits.box_max_m[axis]))
      return Invalid(absl::StrCat("box_min_m[", axis, "]"), limits.box_min_m[axis], "below box_max_m");
  for (int axis = 0; axis < 3; ++axis)
    if (!(limits.ArmBoxMin()[axis] + 2 * limits.arm_margin_m < limits.arm_box_max_m[axis]))
      return Invalid(absl::StrCat("arm_box_min_m[", axis, "]"), limits.ArmBoxMin()[axis],
                     "below arm_box_max_m by more than twice arm_margin_m");
  return CheckJoints(limits, model);
}

}  // namespace touchstone::gateway::arm
