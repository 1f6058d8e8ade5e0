// The path between two poses of the tip that keeps clear of the object: out along the tool's own axis up to a
// plane, across, and in along the axis of the pose to come.
#pragma once

#include <vector>

#include <Eigen/Geometry>

namespace touchstone::gateway::arm {

struct TransitPath {
  Eigen::Isometry3d from, to;     // base_from_tip
  double plane_m = 0;             // height, base frame, that every fingertip crosses at, at least
  double outermost_finger_m = 0;  // from the middle one

  // Poses to go through in straight lines (line_turn.h); the last is `to`. turn = 0: the tool turns in the shorter direction about
  // its axis; +1 or -1: counter-clockwise or clockwise about its z, even if that is the longer turn.
  std::vector<Eigen::Isometry3d> Poses(int turn) const;
};

// Back along the tool's axis by `back_m` (less if it reaches the height before), then straight up
// to the height.
std::vector<Eigen::Isometry3d> RetractPath(const Eigen::Isometry3d& from, double back_m, double height_m);

}  // namespace touchstone::gateway::arm
