#include "server/gateway/arm/ur_modes.h"

#include <absl/strings/str_cat.h>

#include "server/gateway/arm/arm.h"

namespace touchstone {

std::string RobotModeName(int robot_mode) {
  static constexpr const char* kNames[] = {"NO_CONTROLLER", "DISCONNECTED",     "CONFIRM_SAFETY", "BOOTING",
                                           "POWER_OFF",     "POWER_ON",         "IDLE",           "BACKDRIVE",
                                           "RUNNING",       "UPDATING_FIRMWARE"};
  if (robot_mode < -1 || robot_mode > 8) return absl::StrCat("UNKNOWN (", robot_mode, ")");
  return kNames[robot_mode + 1];
}

std::string SafetyModeName(int safety_mode) {
  static constexpr const char* kNames[] = {"NORMAL",
                                           "REDUCED",
                                           "PROTECTIVE_STOP",
                                           "RECOVERY",
                                           "SAFEGUARD_STOP",
                                           "SYSTEM_EMERGENCY_STOP",
                                           "ROBOT_EMERGENCY_STOP",
                                           "VIOLATION",
                                           "FAULT"};
  if (safety_mode < 1 || safety_mode > 9) return absl::StrCat("UNKNOWN (", safety_mode, ")");
  return kNames[safety_mode - 1];
}

absl::Status SafetyPermitsMotion(int safety_mode) {
  const char* what_to_do = "look at the teach pendant";
  if (safety_mode == 1 || safety_mode == 2) return absl::OkStatus();  // reduced: slower, and measured so
  if (safety_mode == 3)
    what_to_do = "find out why, clear the way, then unlock it at the teach pendant; this program never does";
  if (safety_mode == 5) what_to_do = "somebody is inside the safeguard; close it";
  if (safety_mode == 6 || safety_mode == 7) what_to_do = "release the emergency stop, then power the arm on";
  return absl::FailedPreconditionError(absl::StrCat("the arm's safety mode is ", SafetyModeName(safety_mode),
                                                    ", NORMAL is needed: ", what_to_do));
}

absl::Status ModesPermitMotion(int robot_mode, int safety_mode) {
  if (absl::Status safety = SafetyPermitsMotion(safety_mode); !safety.ok()) return safety;
  if (robot_mode == 7) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("the arm's mode is ", RobotModeName(robot_mode),
                   ", RUNNING is needed: power it on and release its brakes, at the teach pendant or with "
                   "'touchstone rig power-on'"));
}

const char* PhaseName(int phase) {
  static constexpr const char* kNames[] = {"none", "transfer", "ready", "approach", "retreat", "done"};
  return phase < 0 || phase > 5 ? "unknown" : kNames[phase];
}

}  // namespace touchstone
