// Packets of the primary and secondary interfaces.
#pragma once

#include <string>

#include "tests/rig/controller/machine/machine.h"

namespace touchstone::rig {

std::string VersionPacket(const std::string& model);
std::string AnnouncementPacket(const Announcement& announcement, double now_s);
// Robot mode, joints, cartesian, kinematics, configuration: 1074 bytes.
std::string StatePacket(const RobotState& state, const ArmGeometry& arm, const std::string& model);

}  // namespace touchstone::rig
