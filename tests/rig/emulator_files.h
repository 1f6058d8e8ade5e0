// The files that an emulated rig writes for those who use it.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "tests/rig/controller.h"
#include "tests/rig/emulator.h"

namespace touchstone::rig {

inline constexpr char kNotice[] =
    "emulated rig: a test tool; nothing that it reports was measured on anything";

// Where things stand. The tip points along the flange's z; the camera looks the same way from beside it.
Eigen::Isometry3d FlangeFromTip();
Eigen::Isometry3d FlangeFromCamera();
inline constexpr double kVerticalFovDeg = 45;
// base_from_object at "+z": the box stands in the middle of the fixture, whose plate is lower than the arm's
// base. A UR3 and a UR3e reach every touch there that is at most 20 deg from straight down with any turn
// about the approach, from a standoff of 60 mm and 50 mm above it to 30 mm behind the target.
Eigen::Isometry3d FixtureOf(const Eigen::Vector3d& box_min_m, const Eigen::Vector3d& box_max_m);

struct EmulatorAddresses {
  Controller::Ports arm;
  int camera_port = 0, control_port = 0;
  std::string program;  // for mount_command; empty: none
};
// Where the emulator's clock is kept for those who follow it.
std::string ClockFile(const EmulatorOptions& options);
// All in options.dir. Throw std::runtime_error.
void WriteCalibration(const EmulatorOptions& options,
                      const std::map<std::string, Eigen::Isometry3d>& base_from_object);
void WriteGatewayConfig(const EmulatorOptions& options, const EmulatorAddresses& addresses);
void WriteAddresses(const EmulatorOptions& options, const EmulatorAddresses& addresses);

}  // namespace touchstone::rig
