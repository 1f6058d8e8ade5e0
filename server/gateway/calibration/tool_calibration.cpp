#include "server/gateway/calibration/tool_calibration.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <cmath>

#include "server/base/numbers/decompositions.h"

namespace touchstone::gateway::calibration {
namespace {

// A spread of the rotations of about 3 degrees.
constexpr double kMinSpread = 0.05;

}  // namespace

absl::StatusOr<ToolCalibration> CalibrateTool(const std::vector<Eigen::Isometry3d>& base_from_flange) {
  const size_t poses = base_from_flange.size();
  if (poses < kMinToolPoses)
    return absl::InvalidArgumentError(
        absl::StrCat("the tool's calibration has ", poses, " flange poses; at least ", kMinToolPoses,
                     " that touch one fixed point, turned about different axes, are needed"));
  // R_k tip + t_k = pivot, for every pose k.
  Eigen::MatrixXd lines(3 * poses, 6);
  Eigen::VectorXd right(3 * poses);
  for (size_t k = 0; k < poses; ++k) {
    if (!base_from_flange[k].matrix().allFinite())
      return absl::InvalidArgumentError(absl::StrCat("flange pose ", k, " has a number that is not finite"));
    lines.block<3, 3>(3 * k, 0) = base_from_flange[k].linear();
    lines.block<3, 3>(3 * k, 3) = -Eigen::Matrix3d::Identity();
    right.segment<3>(3 * k) = -base_from_flange[k].translation();
  }
  const SingularValues svd = SingularValuesOf(lines);
  const double spread = svd.values[5] / std::sqrt(static_cast<double>(poses));
  if (!(spread >= kMinSpread)) {
    const Eigen::Vector3d unknown = svd.v.col(5).head<3>().normalized();
    return absl::InvalidArgumentError(
        absl::StrFormat("the %d flange poses turn too little to tell where the tip stands along (%.2f, %.2f, "
                        "%.2f) of the flange; turn "
                        "the tool by 20 degrees and more about two axes across that direction",
                        poses, unknown.x(), unknown.y(), unknown.z()));
  }
  const Eigen::VectorXd solution = SolveLeastSquares(lines, right);
  const Eigen::VectorXd rest = lines * solution - right;

  ToolCalibration tool;
  tool.flange_from_tip_m = solution.head<3>();
  tool.pivot_m = solution.tail<3>();
  const double variance = rest.squaredNorm() / static_cast<double>(3 * poses - 6);
  tool.rms_m = std::sqrt(variance);
  const Eigen::VectorXd inverse = svd.values.array().square().inverse();
  const Eigen::MatrixXd covariance = variance * svd.v * inverse.asDiagonal() * svd.v.transpose();
  tool.flange_from_tip_std_error_m = covariance.diagonal().head<3>().array().sqrt();
  tool.pivot_std_error_m = covariance.diagonal().tail<3>().array().sqrt();
  for (size_t k = 0; k < poses; ++k) {
    const double off_m = rest.segment<3>(3 * k).norm();
    if (off_m <= tool.worst_m) continue;
    tool.worst_m = off_m;
    tool.worst = k;
  }
  return tool;
}

}  // namespace touchstone::gateway::calibration
