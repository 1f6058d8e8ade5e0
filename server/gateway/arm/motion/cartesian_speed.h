// How fast the tip may go along a line, and the joints along theirs, so that no joint turns faster than it can and no
// part of the arm goes faster than it may.
#pragma once

#include <Eigen/Geometry>

#include "server/gateway/arm/kinematics/arm_body.h"
#include "server/gateway/arm/kinematics/kinematics.h"

namespace touchstone::gateway::arm {

// LineSpeed, or less where a joint would exceed four fifths of its speed or a point of the body its own. *joints, those
// at the beginning, become those at the end; where the arm cannot reach, the line is not followed further.
double LimitedCartesianSpeed(const UrKinematics& kinematics, const ArmBody& body,
                             const Eigen::Isometry3d& tip_from_flange, const Eigen::Isometry3d& from,
                             const Eigen::Isometry3d& to, double speed_m_s, Joints* joints);

// Of the joint that turns farthest, rad/s: `speed_rad_s`, or less for the same reasons.
double LimitedJointSpeed(const UrKinematics& kinematics, const ArmBody& body, const Joints& from,
                         const Joints& to, double speed_rad_s);

// Near a singularity joints turn much faster in the middle of a sample than on average: where one needs this share of its
// speed, samples are so many times closer.
inline constexpr double kFinerFromShare = 0.3;
inline constexpr int kFinerSteps = 16;

// Of the line from one to the other, turning evenly.
Eigen::Isometry3d PoseBetween(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double part);

// Of the way from one to the other, all joints evenly.
Joints JointsBetween(const Joints& from, const Joints& to, double part);

}  // namespace touchstone::gateway::arm
