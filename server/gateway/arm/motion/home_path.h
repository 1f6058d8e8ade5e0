// The way home from anywhere a touch, a photograph or a stop in mid-way can leave the tool.
#pragma once

#include <optional>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Geometry>

#include "server/gateway/arm/kinematics/motion_limits.h"
#include "server/gateway/arm/motion/line_check.h"

namespace touchstone::gateway::arm {

// Straight lines through the poses, then evenly through the joints; every part of it was checked.
struct HomePath {
  std::vector<Eigen::Isometry3d> poses;  // base_from_tip
  std::vector<Joints> joints;            // the last ones are home's
};

// Out along the tool's own axis up to a plane above the object, and there across: in a straight line, by the joints, or
// by the joints after wrist 3 has unwound. `object_top_m`: base frame; none: it is not known what lies on the fixture, and
// the plane is as high as home. OUT_OF_RANGE says why none of the ways passes.
absl::StatusOr<HomePath> FindHomePath(const LineCheck& check, const MotionLimits& limits,
                                      std::optional<double> object_top_m,
                                      const Eigen::Isometry3d& base_from_tip, const Joints& joints);

}  // namespace touchstone::gateway::arm
