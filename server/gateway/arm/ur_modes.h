// The controller's modes in words.
#pragma once

#include <string>

#include <absl/status/status.h>

namespace touchstone {

// "RUNNING", "POWER_OFF", ...; "NORMAL", "PROTECTIVE_STOP", ...; "UNKNOWN (12)" for another number.
std::string RobotModeName(int robot_mode);
std::string SafetyModeName(int safety_mode);

// OK, or FAILED_PRECONDITION with what a person has to do.
absl::Status SafetyPermitsMotion(int safety_mode);
absl::Status ModesPermitMotion(int robot_mode, int safety_mode);

}  // namespace touchstone
