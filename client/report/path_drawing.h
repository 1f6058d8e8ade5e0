// A picture of planned touches, for people who check a plan before it runs: from above and from the side.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace touchstone::client {

// One touch as it was checked. Base frame, metres.
struct DrawnTouch {
  int number = 0;  // in its plan, as messages have it
  bool possible = true;
  std::string reason;                 // what forbids it
  std::vector<Eigen::Vector3d> path;  // of the tip: transit, start, end of the stroke; empty: unknown
  size_t transit_poses = 0;           // how many of the path are the transit; the last of them is the start
  std::optional<Eigen::Vector3d> target_m;  // where a contact is expected
};

struct PathDrawing {
  std::string title;  // "plan.csv on ur3e: 192 touches of lat20"
  std::vector<DrawnTouch> touches;
  std::optional<std::pair<Eigen::Vector3d, Eigen::Vector3d>> object;  // least and greatest corner of its box
  std::optional<std::pair<Eigen::Vector3d, Eigen::Vector3d>> limits;  // of what the tip may reach
};

// An SVG file's text. Impossible touches are red, with their number; the first reasons stand below.
std::string DrawPaths(const PathDrawing& drawing);

}  // namespace touchstone::client
