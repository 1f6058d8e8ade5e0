#include "server/diagnosis/boards/board_pose.h"

#include <algorithm>
#include <cmath>

#include <absl/strings/str_cat.h>
#include <Eigen/Geometry>

#include "server/base/numbers/decompositions.h"
#include "server/diagnosis/boards/rules.h"

namespace touchstone::diagnosis::boards {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

bool TakesPart(const BoardLayout& board, int corner, CornerHalf half) {
  if (half == CornerHalf::kAll) return true;
  const bool even = (corner % board.columns + corner / board.columns) % 2 == 0;
  return even == (half == CornerHalf::kEven);
}

// Of the pose of one picture.
struct PoseEquations {
  double squares = 0;  // infinite if a corner does not lie before the camera
  Matrix6 left = Matrix6::Zero();
  Vector6 right = Vector6::Zero();
};

PoseEquations EquationsAt(const BoardSet& set, const image::PhotoLens& lens, const BoardPose& pose,
                          int picture, CornerHalf half) {
  PoseEquations sums;
  ProjectedCorner projected;
  for (int corner = 0; corner < set.board.corners(); ++corner) {
    if (!TakesPart(set.board, corner, half)) continue;
    if (!ProjectCorner(lens, pose, set.board.CornerM(corner), &projected)) {
      sums.squares = INFINITY;
      return sums;
    }
    const Eigen::Vector2d residual = set.pictures[picture].corners_px[corner] - projected.px;
    sums.squares += residual.squaredNorm();
    sums.left.noalias() += projected.by_pose.transpose() * projected.by_pose;
    sums.right.noalias() += projected.by_pose.transpose() * residual;
  }
  return sums;
}

BoardPose Moved(const BoardPose& pose, const Vector6& by) {
  BoardPose moved = pose;
  const double angle = by.head<3>().norm();
  if (angle > 0)
    moved.rotation = Eigen::AngleAxisd(angle, by.head<3>() / angle).toRotationMatrix() * pose.rotation;
  moved.translation_m += by.tail<3>();
  return moved;
}

// The homography from the board's plane to normalised image coordinates (direct linear transformation, Hartley's
// scaling); false if the corners determine none.
bool Homography(const BoardSet& set, const image::PhotoLens& lens, int picture, Eigen::Matrix3d* homography) {
  const int count = set.board.corners();
  const double size = set.board.square_m * std::max(set.board.columns, set.board.rows);
  const Eigen::Vector2d middle =
      set.board.square_m * 0.5 * Eigen::Vector2d(set.board.columns - 1, set.board.rows - 1);
  Eigen::MatrixXd rows(2 * count, 9);
  for (int corner = 0; corner < count; ++corner) {
    const Eigen::Vector2d from = (set.board.CornerM(corner) - middle) / size;
    const Eigen::Vector2d& px = set.pictures[picture].corners_px[corner];
    const double x = (px.x() - lens.cx) / lens.fx;
    const double y = (px.y() - lens.cy) / lens.fy;
    rows.row(2 * corner) << from.x(), from.y(), 1, 0, 0, 0, -x * from.x(), -x * from.y(), -x;
    rows.row(2 * corner + 1) << 0, 0, 0, from.x(), from.y(), 1, -y * from.x(), -y * from.y(), -y;
  }
  const SingularValues svd = SingularValuesOf(rows);
  if (!(svd.values[7] > 1e-9 * svd.values[0])) return false;
  const Eigen::VectorXd h = svd.v.col(8);
  Eigen::Matrix3d scaled, back;
  scaled << h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8];
  back << 1 / size, 0, -middle.x() / size, 0, 1 / size, -middle.y() / size, 0, 0, 1;
  *homography = scaled * back;
  // A board that is seen as a line, or a picture of nothing.
  const Eigen::VectorXd shape = SingularValuesOf(scaled).values;
  return shape[2] > 1e-6 * shape[0];
}

}  // namespace

bool ProjectCorner(const image::PhotoLens& lens, const BoardPose& pose, const Eigen::Vector2d& corner_m,
                   ProjectedCorner* projected) {
  const Eigen::Vector3d turned = pose.rotation.leftCols<2>() * corner_m;
  const Eigen::Vector3d point = turned + pose.translation_m;
  if (!(point.z() > 1e-9)) return false;
  projected->px = lens.Project(point);
  const Eigen::Matrix<double, 2, 3> by_point = lens.ProjectDerivative(point);
  Eigen::Matrix3d cross;  // by a turn w the point moves by w x turned
  cross << 0, turned.z(), -turned.y(), -turned.z(), 0, turned.x(), turned.y(), -turned.x(), 0;
  projected->by_pose << by_point * cross, by_point;
  return true;
}

absl::StatusOr<std::vector<BoardPose>> StartPoses(const BoardSet& set, const image::PhotoLens& lens) {
  std::vector<BoardPose> poses;
  for (int picture = 0; picture < static_cast<int>(set.pictures.size()); ++picture) {
    Eigen::Matrix3d h;
    if (!Homography(set, lens, picture, &h))
      return absl::FailedPreconditionError(
          absl::StrCat(set.pictures[picture].file,
                       ": the corners of the board lie on a line; a picture of its face was expected"));
    double scale = 1 / std::sqrt(h.col(0).norm() * h.col(1).norm());
    if (h(2, 2) < 0) scale = -scale;  // before the camera
    Eigen::Matrix3d axes;
    axes << scale * h.col(0), scale * h.col(1), (scale * h.col(0)).cross(scale * h.col(1));
    const SingularValues svd = SingularValuesOf(axes);
    BoardPose pose;
    pose.rotation = svd.u * svd.v.transpose();
    pose.translation_m = scale * h.col(2);
    poses.push_back(FitPose(set, lens, picture, pose));
    if (!std::isfinite(EquationsAt(set, lens, poses.back(), picture, CornerHalf::kAll).squares))
      return absl::FailedPreconditionError(absl::StrCat(set.pictures[picture].file,
                                                        ": a part of the board would lie behind the camera; "
                                                        "a picture of the board's face and the camera.yaml "
                                                        "of these pictures were expected"));
  }
  return poses;
}

BoardPose FitPose(const BoardSet& set, const image::PhotoLens& lens, int picture, BoardPose start,
                  CornerHalf half) {
  BoardPose pose = std::move(start);
  PoseEquations here = EquationsAt(set, lens, pose, picture, half);
  double damping = 1e-4;
  for (int iteration = 0; iteration < kBoardRules.max_iterations && std::isfinite(here.squares);
       ++iteration) {
    BoardPose next;
    PoseEquations there;
    do {
      Matrix6 damped = here.left;
      damped.diagonal() *= 1 + damping;
      next = Moved(pose, SymmetricSolver(damped).Solve(here.right));
      there = EquationsAt(set, lens, next, picture, half);
      damping *= there.squares <= here.squares ? 0.1 : 10;
    } while (!(there.squares <= here.squares) && damping < kBoardRules.max_damping);
    if (!(there.squares <= here.squares)) break;
    const bool converged = here.squares - there.squares <= kBoardRules.converged * here.squares;
    pose = next;
    here = there;
    damping = std::max(damping, 1e-12);
    if (converged) break;
  }
  return pose;
}

double UnseenSquares(const BoardSet& set, const image::PhotoLens& lens, int picture, const BoardPose& start) {
  double sum = 0;
  for (const auto& [seen, unseen] :
       {std::pair(CornerHalf::kEven, CornerHalf::kOdd), std::pair(CornerHalf::kOdd, CornerHalf::kEven)})
    sum += EquationsAt(set, lens, FitPose(set, lens, picture, start, seen), picture, unseen).squares;
  return sum;
}

}  // namespace touchstone::diagnosis::boards
