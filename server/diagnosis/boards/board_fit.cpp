#include "server/diagnosis/boards/board_fit.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Geometry>

#include <absl/strings/str_cat.h>

#include "server/base/decompositions.h"

namespace touchstone::diagnosis::boards {
namespace {

constexpr int kMaxIterations = 200;
constexpr double kConverged = 1e-12;  // relative fall of the sum of squares
constexpr double kMaxDamping = 1e12;

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

bool TakesPart(const BoardLayout& board, int corner, CornerHalf half) {
  if (half == CornerHalf::kAll) return true;
  const bool even = (corner % board.columns + corner / board.columns) % 2 == 0;
  return even == (half == CornerHalf::kEven);
}

// Sum of squares over the half of a picture's corners; infinite if one does not lie before the camera.
double Squares(const BoardSet& set, const LensVector& lens, const BoardPose& pose, int picture,
               CornerHalf half) {
  double sum = 0;
  ProjectedCorner projected;
  for (int corner = 0; corner < set.board.corners(); ++corner) {
    if (!TakesPart(set.board, corner, half)) continue;
    if (!ProjectCorner(set.camera, lens, pose, set.board.CornerM(corner), &projected)) return INFINITY;
    sum += (set.pictures[picture].corners_px[corner] - projected.px).squaredNorm();
  }
  return sum;
}

// Normal equations of one picture.
struct PictureEquations {
  Eigen::MatrixXd lens;       // free x free
  Eigen::MatrixXd lens_pose;  // free x 6
  Matrix6 pose = Matrix6::Zero();
  Eigen::VectorXd lens_right;
  Vector6 pose_right = Vector6::Zero();
};

PictureEquations Equations(const BoardSet& set, const LensVector& lens, const BoardPose& pose, int picture,
                           const std::vector<int>& free, CornerHalf half) {
  const int count = static_cast<int>(free.size());
  PictureEquations sums;
  sums.lens = Eigen::MatrixXd::Zero(count, count);
  sums.lens_pose = Eigen::MatrixXd::Zero(count, 6);
  sums.lens_right = Eigen::VectorXd::Zero(count);
  ProjectedCorner projected;
  Eigen::MatrixXd by_free(2, count);
  for (int corner = 0; corner < set.board.corners(); ++corner) {
    if (!TakesPart(set.board, corner, half)) continue;
    if (!ProjectCorner(set.camera, lens, pose, set.board.CornerM(corner), &projected)) continue;
    const Eigen::Vector2d residual = set.pictures[picture].corners_px[corner] - projected.px;
    for (int k = 0; k < count; ++k) by_free.col(k) = projected.by_lens.col(free[k]);
    sums.lens += by_free.transpose() * by_free;
    sums.lens_pose += by_free.transpose() * projected.by_pose;
    sums.pose += projected.by_pose.transpose() * projected.by_pose;
    sums.lens_right += by_free.transpose() * residual;
    sums.pose_right += projected.by_pose.transpose() * residual;
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

// One damped step of lens and poses; the pose of each picture follows from the step of the lens.
void Step(const std::vector<PictureEquations>& equations, const std::vector<double>& weights,
          const std::vector<int>& free, double damping, BoardFit* fit) {
  const int count = static_cast<int>(free.size());
  Eigen::MatrixXd left = Eigen::MatrixXd::Zero(count, count);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(count), diagonal = Eigen::VectorXd::Zero(count);
  std::vector<std::optional<SymmetricSolver>> solvers(equations.size());
  for (size_t i = 0; i < equations.size(); ++i) {
    if (weights[i] == 0) continue;
    Matrix6 damped = equations[i].pose;
    damped.diagonal() *= 1 + damping;
    solvers[i].emplace(damped);
    if (count == 0) continue;  // poses alone
    left +=
        weights[i] * (equations[i].lens -
                      equations[i].lens_pose * solvers[i]->SolveColumns(equations[i].lens_pose.transpose()));
    right += weights[i] *
             (equations[i].lens_right - equations[i].lens_pose * solvers[i]->Solve(equations[i].pose_right));
    diagonal += weights[i] * equations[i].lens.diagonal();
  }
  Eigen::VectorXd step = Eigen::VectorXd::Zero(count);
  if (count > 0) {
    left.diagonal() += damping * diagonal;
    step = SymmetricSolver(left).Solve(right);
  }
  for (int k = 0; k < count; ++k) fit->lens[free[k]] += step[k];
  for (size_t i = 0; i < equations.size(); ++i) {
    if (weights[i] == 0) continue;
    const Vector6 pose_right = equations[i].pose_right - equations[i].lens_pose.transpose() * step;
    fit->poses[i] = Moved(fit->poses[i], solvers[i]->Solve(pose_right));
  }
}

BoardFit FitHalf(const BoardSet& set, BoardFit fit, const std::vector<int>& free,
                 const std::vector<double>& weights, CornerHalf half) {
  const int pictures = static_cast<int>(set.pictures.size());
  const auto measure = [&](BoardFit* at) {
    at->squares_px2.assign(pictures, 0);
    at->sum_px2 = 0;
    for (int i = 0; i < pictures; ++i) {
      if (weights[i] == 0) continue;
      at->squares_px2[i] = Squares(set, at->lens, at->poses[i], i, half);
      at->sum_px2 += weights[i] * at->squares_px2[i];
    }
  };
  measure(&fit);
  double damping = 1e-4;
  for (int iteration = 0; iteration < kMaxIterations && std::isfinite(fit.sum_px2); ++iteration) {
    std::vector<PictureEquations> equations(pictures);
    for (int i = 0; i < pictures; ++i)
      if (weights[i] != 0) equations[i] = Equations(set, fit.lens, fit.poses[i], i, free, half);
    BoardFit next;
    do {
      next = fit;
      Step(equations, weights, free, damping, &next);
      measure(&next);
      damping *= next.sum_px2 <= fit.sum_px2 ? 0.1 : 10;
    } while (!(next.sum_px2 <= fit.sum_px2) && damping < kMaxDamping);
    if (!(next.sum_px2 <= fit.sum_px2)) break;
    const bool converged = fit.sum_px2 - next.sum_px2 <= kConverged * fit.sum_px2;
    fit = std::move(next);
    damping = std::max(damping, 1e-12);
    if (converged) break;
  }
  return fit;
}

// The homography from the board's plane to normalised image coordinates (direct linear transformation, Hartley's
// scaling); false if the corners determine none.
bool Homography(const BoardSet& set, int picture, Eigen::Matrix3d* homography) {
  const int count = set.board.corners();
  const double size = set.board.square_m * std::max(set.board.columns, set.board.rows);
  const Eigen::Vector2d middle =
      set.board.square_m * 0.5 * Eigen::Vector2d(set.board.columns - 1, set.board.rows - 1);
  Eigen::MatrixXd rows(2 * count, 9);
  for (int corner = 0; corner < count; ++corner) {
    const Eigen::Vector2d from = (set.board.CornerM(corner) - middle) / size;
    const Eigen::Vector2d& px = set.pictures[picture].corners_px[corner];
    const double x = (px.x() - set.camera.cx_px) / set.camera.fx_px;
    const double y = (px.y() - set.camera.cy_px) / set.camera.fy_px;
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

absl::StatusOr<BoardFit> StartFit(const BoardSet& set) {
  BoardFit fit;
  for (size_t i = 0; i < set.pictures.size(); ++i) {
    Eigen::Matrix3d h;
    if (!Homography(set, static_cast<int>(i), &h))
      return absl::FailedPreconditionError(
          absl::StrCat(set.pictures[i].file,
                       ": the corners of the board lie on a line; a picture of its face was expected"));
    double scale = 1 / std::sqrt(h.col(0).norm() * h.col(1).norm());
    if (h(2, 2) < 0) scale = -scale;  // before the camera
    Eigen::Matrix3d axes;
    axes << scale * h.col(0), scale * h.col(1), (scale * h.col(0)).cross(scale * h.col(1));
    const SingularValues svd = SingularValuesOf(axes);
    BoardPose pose;
    pose.rotation = svd.u * svd.v.transpose();
    pose.translation_m = scale * h.col(2);
    fit.poses.push_back(pose);
  }
  return FitBoards(set, std::move(fit), {});
}

BoardFit FitBoards(const BoardSet& set, BoardFit fit, const std::vector<int>& free,
                   const std::vector<double>& weights) {
  return FitHalf(set, std::move(fit), free,
                 weights.empty() ? std::vector<double>(set.pictures.size(), 1.0) : weights, CornerHalf::kAll);
}

double UnseenSquares(const BoardSet& set, const BoardFit& fit, int picture) {
  std::vector<double> only(set.pictures.size(), 0.0);
  only[picture] = 1;
  double sum = 0;
  for (const auto& [seen, unseen] :
       {std::pair(CornerHalf::kEven, CornerHalf::kOdd), std::pair(CornerHalf::kOdd, CornerHalf::kEven)}) {
    const BoardFit half = FitHalf(set, fit, {}, only, seen);
    sum += Squares(set, half.lens, half.poses[picture], picture, unseen);
  }
  return sum;
}

}  // namespace touchstone::diagnosis::boards
