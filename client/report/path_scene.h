// One view in space of planned touches, as a part of an SVG file: parallel projection, base frame.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "client/report/path_drawing.h"

namespace touchstone::client {

struct SceneFrame {
  std::string id;  // of its clip path
  double left, top, width, height;
};

// The object with its approaches, as large as fits.
std::string DrawCloseUp(const SceneFrame& frame, const DrawnFace& face);
// The whole arm at the start of the first touch that is possible, where wrist and camera go for the others, and the
// limits.
std::string DrawOverview(const SceneFrame& frame, const DrawnFace& face, const PathDrawing& drawing);

}  // namespace touchstone::client
