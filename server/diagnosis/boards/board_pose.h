// Where the board of each picture stands: the nuisance that every fit of a lens eliminates.
#pragma once

#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "server/diagnosis/boards/board_set.h"
#include "server/diagnosis/boards/lens.h"

namespace touchstone::diagnosis::boards {

// From the board's frame to the camera's (x right, y down, z forward).
struct BoardPose {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation_m = Eigen::Vector3d::UnitZ();
};

struct ProjectedCorner {
  Eigen::Vector2d px;
  // By a turn (rotation vector in the camera's axes, about the board's origin) and by a shift of the board.
  Eigen::Matrix<double, 2, 6> by_pose;
};

// False: the point does not lie before the camera, whatever the lens.
bool ProjectCorner(const image::PhotoLens& lens, const BoardPose& pose, const Eigen::Vector2d& corner_m,
                   ProjectedCorner* projected);

// The corners that take part in a fit.
enum class CornerHalf { kAll, kEven, kOdd };  // like the colours of a chessboard

// Of every picture, from its homography. FAILED_PRECONDITION names a picture whose corners determine none.
absl::StatusOr<std::vector<BoardPose>> StartPoses(const BoardSet& set, const image::PhotoLens& lens);

// Least squares from a pose that has the whole board before the camera, and so has the answer (Levenberg, Marquardt).
BoardPose FitPose(const BoardSet& set, const image::PhotoLens& lens, int picture, BoardPose start,
                  CornerHalf half = CornerHalf::kAll);

// The sum of squares (px^2) of one half of the corners of a picture where its pose was fitted to the other half, both
// ways round: the error on corners that nothing was fitted to.
double UnseenSquares(const BoardSet& set, const image::PhotoLens& lens, int picture, const BoardPose& start);

}  // namespace touchstone::diagnosis::boards
