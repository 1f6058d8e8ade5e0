// A picture of planned touches, for people who check a plan before it runs: two views in space for every face that has
// to point up, near the object and of the whole arm.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace touchstone::client {

// Where the arm is. Base frame, metres.
struct DrawnPosture {
  std::vector<Eigen::Vector3d> links;  // base, shoulder, elbow, wrist 1 to 3, flange
  std::optional<Eigen::Vector3d> camera;
  std::vector<Eigen::Vector3d> tips;  // of the fingers
};

// One touch as it was checked. Base frame, metres.
struct DrawnTouch {
  int number = 0;  // in its plan, as messages have it
  bool possible = true;
  std::string reason;                 // what forbids it
  std::vector<std::string> notes;     // what does not, but is worth knowing
  std::vector<Eigen::Vector3d> path;  // of the tip: transit, start, end of the stroke; empty: unknown
  size_t transit_poses = 0;           // how many of the path are the transit; the last of them is the start
  std::optional<Eigen::Vector3d> target_m;  // where a contact is expected
  DrawnPosture start;                       // empty: unknown
};

// The touches of one object lying one way.
struct DrawnFace {
  std::string title;  // "lat20 with its face +z up"
  std::optional<std::array<Eigen::Vector3d, 8>>
      object;  // corners of its box; bit k of the index: the greater x, y, z
  std::vector<DrawnTouch> touches;
};

struct PathDrawing {
  std::string title;  // "plan.csv on ur3e: 192 touches"
  std::vector<DrawnFace> faces;
  std::optional<std::pair<Eigen::Vector3d, Eigen::Vector3d>>
      limits;  // of what the tips may reach: least, greatest
};

// An SVG file's text. Impossible touches are red, with their number; the first reasons and notes stand below. The legend
// has what is drawn, and nothing else.
std::string DrawPaths(const PathDrawing& drawing);

}  // namespace touchstone::client
