// The controller's modes in words, and whether they permit motion.
#pragma once

#include <string>

#include <absl/status/status.h>

#include "server/gateway/arm/arm.h"

namespace touchstone::gateway::arm {

// Universal Robots' words: "RUNNING", "POWER_OFF", ...; "NORMAL", "PROTECTIVE_STOP", ...; "UNKNOWN (12)" for a
// number without a name.
std::string RobotModeName(RobotMode mode);
std::string SafetyModeName(SafetyMode mode);
// "transit", "approach", ...; "unknown" for a number without a name.
const char* PhaseName(MotionPhase phase);

// OK, or FAILED_PRECONDITION with what a person has to do.
absl::Status SafetyPermitsMotion(SafetyMode safety_mode);
absl::Status ModesPermitMotion(RobotMode robot_mode, SafetyMode safety_mode);

}  // namespace touchstone::gateway::arm
