// How far the tool may turn on one straight line. A line between two orientations that are nearly half a turn apart has two
// directions; movel documents no choice between them (UR script manual), and which one a controller takes depends on
// rounding. What was checked would not be what is driven, so every line of every program turns less.
#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>
#include <Eigen/Geometry>

namespace touchstone::gateway::arm {

// A third of a full turn: the longer way round an axis goes in three lines. What is left to half a turn, 60 deg, is far
// more than the pose that a line was planned from and the one where the arm really stands can differ by (0.15 rad).
inline constexpr double kMaxLineTurnRad = 2.0943951023931953;

// Between two poses, the shorter way round.
double TurnRad(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to);

// The same straight lines from `from` through the poses, with further poses on those that turn the tool farther than
// kMaxLineTurnRad.
std::vector<Eigen::Isometry3d> SplitTurns(Eigen::Isometry3d from,
                                          const std::vector<Eigen::Isometry3d>& poses);

// OUT_OF_RANGE with value and limit for a line that turns the tool farther.
absl::Status CheckLineTurn(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to,
                           const std::string& what);

}  // namespace touchstone::gateway::arm
