#include "server/gateway/arm/ur_modes.h"

#include <absl/strings/str_cat.h>

namespace touchstone::gateway::arm {

std::string RobotModeName(RobotMode mode) {
  static constexpr const char* kNames[] = {"NO_CONTROLLER", "DISCONNECTED",     "CONFIRM_SAFETY", "BOOTING",
                                           "POWER_OFF",     "POWER_ON",         "IDLE",           "BACKDRIVE",
                                           "RUNNING",       "UPDATING_FIRMWARE"};
  const int number = static_cast<int>(mode);
  if (mode < RobotMode::kNoController || mode > RobotMode::kUpdatingFirmware)
    return absl::StrCat("UNKNOWN (", number, ")");
  return kNames[number - static_cast<int>(RobotMode::kNoController)];
}

std::string SafetyModeName(SafetyMode mode) {
  static constexpr const char* kNames[] = {"NORMAL",
                                           "REDUCED",
                                           "PROTECTIVE_STOP",
                                           "RECOVERY",
                                           "SAFEGUARD_STOP",
                                           "SYSTEM_EMERGENCY_STOP",
                                           "ROBOT_EMERGENCY_STOP",
                                           "VIOLATION",
                                           "FAULT"};
  const int number = static_cast<int>(mode);
  if (mode < SafetyMode::kNormal || mode > SafetyMode::kFault) return absl::StrCat("UNKNOWN (", number, ")");
  return kNames[number - static_cast<int>(SafetyMode::kNormal)];
}

const char* PhaseName(MotionPhase phase) {
  static constexpr const char* kNames[] = {"none", "transit", "ready", "approach", "retract", "done"};
  if (phase < MotionPhase::kNone || phase > MotionPhase::kDone) return "unknown";
  return kNames[static_cast<int>(phase)];
}

absl::Status SafetyPermitsMotion(SafetyMode safety_mode) {
  const char* what_to_do = "look at the teach pendant";
  switch (safety_mode) {
    case SafetyMode::kNormal:
    case SafetyMode::kReduced:  // slower, and a touch whose speed was scaled is refused
      return absl::OkStatus();
    case SafetyMode::kProtectiveStop:
      what_to_do =
          "find out why, clear the way, then unlock it at the teach pendant; this program never does";
      break;
    case SafetyMode::kRecovery:
      what_to_do = "the arm is outside its safety limits: move it back by hand at the teach pendant";
      break;
    case SafetyMode::kSafeguardStop:
      what_to_do = "somebody is inside the safeguard; close it";
      break;
    case SafetyMode::kSystemEmergencyStop:
    case SafetyMode::kRobotEmergencyStop:
      what_to_do = "release the emergency stop, then power the arm on";
      break;
    case SafetyMode::kUnspecified:
    case SafetyMode::kViolation:
    case SafetyMode::kFault:
      break;
  }
  return absl::FailedPreconditionError(absl::StrCat("the arm's safety mode is ", SafetyModeName(safety_mode),
                                                    ", NORMAL is needed: ", what_to_do));
}

absl::Status ModesPermitMotion(RobotMode robot_mode, SafetyMode safety_mode) {
  if (absl::Status safety = SafetyPermitsMotion(safety_mode); !safety.ok()) return safety;
  if (robot_mode == RobotMode::kRunning) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("the arm's mode is ", RobotModeName(robot_mode),
                   ", RUNNING is needed: power it on and release its brakes, at the teach pendant or with "
                   "'touchstone rig power-on'"));
}

}  // namespace touchstone::gateway::arm
