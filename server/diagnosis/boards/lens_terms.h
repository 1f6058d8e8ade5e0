// The lens of a board's pictures as nine numbers, and how a corner's place in the picture depends on them.
//
// With x = X / Z, y = Y / Z of the camera frame and r^2 = x^2 + y^2 (OpenCV's model):
//   x_d = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2),   y_d alike with p1 and p2 exchanged
//   u = fx (1 + relative) (1 + aspect) x_d + cx + offset_x,   v = fy (1 + relative) y_d + cy + offset_y
#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "server/session/image_set.h"

namespace touchstone::diagnosis::boards {

// What a lens differs from the nominal one by; zero: the nominal lens.
enum LensEntry { kFocal, kOffsetX, kOffsetY, kK1, kK2, kP1, kP2, kK3, kAspect, kLensEntries };
using LensVector = Eigen::Matrix<double, kLensEntries, 1>;

// Entries that are fitted together because one cause has them all.
struct LensTerm {
  const char* name;  // the effect's; of a nameless one a few words
  std::vector<int> entries;
  bool named = true;  // an effect of the catalogue
};
// Effects of the catalogue first.
const std::vector<LensTerm>& LensTerms();

// From the board's frame to the camera's (x right, y down, z forward).
struct BoardPose {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation_m = Eigen::Vector3d::UnitZ();
};

struct ProjectedCorner {
  Eigen::Vector2d px;
  Eigen::Matrix<double, 2, kLensEntries> by_lens;
  // By a turn (rotation vector in the camera's axes, about the board's origin) and by a shift of the board.
  Eigen::Matrix<double, 2, 6> by_pose;
};

// False: the point does not lie before the camera.
bool ProjectCorner(const session::CameraIntrinsics& nominal, const LensVector& lens, const BoardPose& pose,
                   const Eigen::Vector2d& corner_m, ProjectedCorner* projected);

}  // namespace touchstone::diagnosis::boards
