#include "server/gateway/arm/ur_modes.h"

#include <absl/strings/str_cat.h>

namespace touchstone::gateway::arm {
namespace {

struct SafetyRow {
  SafetyMode mode;
  const char* name;
  SafetyKind kind;
};
// A touch in mode REDUCED is slower than commanded, and is refused for that.
constexpr SafetyRow kSafetyRows[] = {
    {SafetyMode::kNormal, "NORMAL", SafetyKind::kPermitsMotion},
    {SafetyMode::kReduced, "REDUCED", SafetyKind::kPermitsMotion},
    {SafetyMode::kProtectiveStop, "PROTECTIVE_STOP", SafetyKind::kProtectiveStop},
    {SafetyMode::kRecovery, "RECOVERY", SafetyKind::kRecovery},
    {SafetyMode::kSafeguardStop, "SAFEGUARD_STOP", SafetyKind::kSafeguard},
    {SafetyMode::kSystemEmergencyStop, "SYSTEM_EMERGENCY_STOP", SafetyKind::kEmergencyStop},
    {SafetyMode::kRobotEmergencyStop, "ROBOT_EMERGENCY_STOP", SafetyKind::kEmergencyStop},
    {SafetyMode::kViolation, "VIOLATION", SafetyKind::kFault},
    {SafetyMode::kFault, "FAULT", SafetyKind::kFault},
    {SafetyMode::kValidateJointId, "VALIDATE_JOINT_ID", SafetyKind::kFault},
    {SafetyMode::kUndefined, "UNDEFINED_SAFETY_MODE", SafetyKind::kFault},
    {SafetyMode::kAutomaticModeSafeguardStop, "AUTOMATIC_MODE_SAFEGUARD_STOP", SafetyKind::kSafeguard},
    {SafetyMode::kSystemThreePositionEnablingStop, "SYSTEM_THREE_POSITION_ENABLING_STOP",
     SafetyKind::kSafeguard},
    {SafetyMode::kPendantThreePositionEnablingStop, "TP_THREE_POSITION_ENABLING_STOP",
     SafetyKind::kSafeguard},
    {SafetyMode::kImmiEmergencyStop, "IMMI_EMERGENCY_STOP", SafetyKind::kEmergencyStop},
    {SafetyMode::kImmiSafeguardStop, "IMMI_SAFEGUARD_STOP", SafetyKind::kSafeguard},
    {SafetyMode::kProfisafeWaitingForParameters, "PROFISAFE_WAITING_FOR_PARAMETERS", SafetyKind::kFault},
    {SafetyMode::kProfisafeAutomaticModeSafeguardStop, "PROFISAFE_AUTOMATIC_MODE_SAFEGUARD_STOP",
     SafetyKind::kSafeguard},
    {SafetyMode::kProfisafeSafeguardStop, "PROFISAFE_SAFEGUARD_STOP", SafetyKind::kSafeguard},
    {SafetyMode::kProfisafeEmergencyStop, "PROFISAFE_EMERGENCY_STOP", SafetyKind::kEmergencyStop},
    {SafetyMode::kSafetyApiSafeguardStop, "SAFETY_API_SAFEGUARD_STOP", SafetyKind::kSafeguard},
    {SafetyMode::kIoPlaneStop, "IO_PLANE_STOP", SafetyKind::kFault},
};

const SafetyRow* Find(SafetyMode mode) {
  for (const SafetyRow& row : kSafetyRows)
    if (row.mode == mode) return &row;
  return nullptr;
}

}  // namespace

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
  const SafetyRow* row = Find(mode);
  return row != nullptr ? row->name : absl::StrCat("UNKNOWN (", static_cast<int>(mode), ")");
}

SafetyKind KindOf(SafetyMode mode) {
  const SafetyRow* row = Find(mode);
  return row != nullptr ? row->kind : SafetyKind::kFault;
}

const char* PhaseName(MotionPhase phase) {
  static constexpr const char* kNames[] = {"none", "transit", "ready", "approach", "retract", "done"};
  if (phase < MotionPhase::kNone || phase > MotionPhase::kDone) return "unknown";
  return kNames[static_cast<int>(phase)];
}

absl::Status SafetyPermitsMotion(SafetyMode safety_mode) {
  const char* what_to_do = "";
  switch (KindOf(safety_mode)) {
    case SafetyKind::kPermitsMotion:
      return absl::OkStatus();
    case SafetyKind::kProtectiveStop:
      what_to_do =
          "find out why, clear the way, then unlock it at the teach pendant; this program never does";
      break;
    case SafetyKind::kRecovery:
      what_to_do = "the arm is outside its safety limits: move it back by hand at the teach pendant";
      break;
    case SafetyKind::kSafeguard:
      what_to_do = "somebody is inside the safeguard, or the enabling device is not held; close it";
      break;
    case SafetyKind::kEmergencyStop:
      what_to_do = "release the emergency stop, then power the arm on";
      break;
    case SafetyKind::kFault:
      what_to_do = "look at the teach pendant";
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
