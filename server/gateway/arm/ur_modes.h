// The controller's modes in words, and whether they permit motion.
#pragma once

#include <string>

#include <absl/status/status.h>

#include "server/gateway/arm/arm.h"

namespace touchstone::gateway::arm {

// Universal Robots' words: "RUNNING", "POWER_OFF", ...; "NORMAL", "PROTECTIVE_STOP", ...; "UNKNOWN (42)" for a
// number without a name.
std::string RobotModeName(RobotMode mode);
std::string SafetyModeName(SafetyMode mode);
// "transit", "approach", ...; "unknown" for a number without a name.
const char* PhaseName(MotionPhase phase);

// What a safety mode means for somebody who wants to move the arm.
enum class SafetyKind {
  kPermitsMotion,
  kProtectiveStop,
  kRecovery,
  // A door, a light curtain, an enabling device that was let go: made for every cycle, and gone without a reset.
  kSafeguard,
  kEmergencyStop,
  kFault,  // also every mode that is not known
};
SafetyKind KindOf(SafetyMode mode);

// OK, or FAILED_PRECONDITION with what a person has to do.
absl::Status SafetyPermitsMotion(SafetyMode safety_mode);
absl::Status ModesPermitMotion(RobotMode robot_mode, SafetyMode safety_mode);

}  // namespace touchstone::gateway::arm
