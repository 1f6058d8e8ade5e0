// How fast the tip may go along a line so that no joint has to turn faster than it can.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Geometry>

#include "server/gateway/arm/kinematics.h"

namespace touchstone::gateway::arm {

// rad/s, base to wrist 3.
const std::array<double, 6>& MaxJointSpeeds();

// LineSpeed, or less where a joint would exceed four fifths of its speed. *joints, those at the beginning,
// become those at the end; where the arm cannot reach, the line is not followed further.
double LimitedCartesianSpeed(const UrKinematics& kinematics, const Eigen::Isometry3d& tip_from_flange,
                             const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double speed_m_s,
                             Joints* joints);

}  // namespace touchstone::gateway::arm
