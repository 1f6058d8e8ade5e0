// Values from every photograph, near where a search found them, and how sure they are.
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/status.h"
#include "server/diagnosis/images/photo_search.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr PhotoRowsOptions kPolish = {12544, 1, 100, true, 0.01};
constexpr int kValleys = 2, kValleyPasses = 3;
constexpr double kMaxWider = 100;      // of a variance
constexpr double kFarEnough = 4;       // standard errors to the end of a valley, that ask for another look
constexpr double kRoughSquares = 0.5;  // of the squares, that contours move by chance

// Along the directions that the rows say least of, contours that cross single pixels hide the slope: there the error at
// several places, a few standard errors apart, shows where its minimum lies.
absl::StatusOr<bool> SearchValleys(const inference::Experiment& experiment, inference::Fit* fit) {
  const int p = fit->model.size();
  if (p < 2) return false;
  const inference::ObservationModel& rows = *experiment.observations;
  Eigen::VectorXd scale(p);
  for (int i = 0; i < p; ++i) scale[i] = fit->model.parameters()[i].scale;
  const Eigen::MatrixXd scaled = fit->columns.values.rightCols(p) * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled.transpose() * scaled);
  const auto squares_at = [&](const Eigen::VectorXd& point) -> absl::StatusOr<double> {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> predicted,
                                rows.Predict(fit->model.At(fit->model.Clip(point))));
    return rows.Residual(predicted).squaredNorm();
  };
  TOUCHSTONE_ASSIGN_OR_RETURN(const double start, squares_at(fit->point));
  Eigen::VectorXd best = fit->point;
  double least = start, farthest = 0;
  Eigen::MatrixXd wider = Eigen::MatrixXd::Zero(p, p);
  for (int valley = 0; valley < std::min(p, kValleys); ++valley) {
    if (!(eigen.eigenvalues()[valley] > 0)) continue;
    const Eigen::VectorXd way =
        scale.cwiseProduct(eigen.eigenvectors().col(valley)) / std::sqrt(eigen.eigenvalues()[valley]);
    // squares = a + b t + c t^2 through all places
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    const Eigen::VectorXd from = best;
    for (const double t : {-12.0, -8.0, -4.0, 0.0, 4.0, 8.0, 12.0}) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const double squares, squares_at(from + t * way));
      const Eigen::Vector3d term(1, t, t * t);
      normal += term * term.transpose();
      right += squares * term;
      if (squares < least) least = squares, best = fit->model.Clip(from + t * way);
    }
    const Eigen::Vector3d curve = normal.ldlt().solve(right);
    if (!(curve[2] > 0)) continue;
    // Derivatives are rough too, which makes them long: the curve's width is the honest one.
    wider += std::max(std::min(1 / curve[2], kMaxWider) - 1, 0.0) * fit->sigma * fit->sigma * way *
             way.transpose();
    farthest = std::max(farthest, std::abs(0.5 * curve[1] / curve[2]));
    const Eigen::VectorXd lowest = from + std::clamp(-0.5 * curve[1] / curve[2], -12.0, 12.0) * way;
    TOUCHSTONE_ASSIGN_OR_RETURN(const double squares, squares_at(lowest));
    // The curve's minimum is surer than any one place, whose contours may happen to lie well.
    if (squares < start || squares < least + kRoughSquares)
      least = std::min(least, squares), best = fit->model.Clip(lowest);
  }
  inference::Parameterization there = fit->model;
  there.MoveTo(best);
  TOUCHSTONE_ASSIGN_OR_RETURN(inference::Fit again, inference::FitModel(experiment, there));
  const bool better = again.columns.values.col(0).squaredNorm() < start + kRoughSquares;
  if (better) *fit = std::move(again);
  fit->covariance += wider;
  return better && farthest > kFarEnough;
}

}  // namespace

absl::StatusOr<PhotoSearch> MakePolishRows(const Photographs& photographs, const model::Model& anchor,
                                           const DiagnosisContext& context) {
  return MakePhotoSearch(photographs, anchor, {}, kPolish, context);
}

absl::Status PolishExplanation(const Photographs& photographs, const DiagnosisContext& context,
                               PhotoSelection* selection) {
  selection->polished = selection->fit;
  if (selection->fit.model.size() == 0) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const PhotoSearch all,
                              MakePolishRows(photographs, selection->fit.model.base(), context));
  const inference::Likelihood plain(all.rows->GroupRows(), nullptr, 0, nullptr);
  inference::Experiment experiment = *all.experiment;
  if (selection->fit.hypothesis == 0) experiment.likelihood = &plain;
  TOUCHSTONE_ASSIGN_OR_RETURN(selection->polished, inference::FitModel(experiment, selection->fit.model));
  for (int pass = 0; pass < kValleyPasses; ++pass) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool moved, SearchValleys(experiment, &selection->polished));
    if (!moved) break;
  }
  selection->covariance = CovarianceBetweenBlocks(experiment, selection->polished);
  return absl::OkStatus();
}

Eigen::MatrixXd CovarianceBetweenBlocks(const inference::Experiment& experiment, const inference::Fit& fit) {
  const int p = fit.model.size(), n = experiment.observations->rows();
  if (p == 0) return fit.covariance;
  const Eigen::VectorXd left =
      fit.columns.values.col(0) -
      experiment.likelihood->FieldMean(inference::Likelihood::Pick(fit.columns, {0}), fit.hypothesis);
  std::map<int, Eigen::VectorXd> scores;
  for (int row = 0; row < n; ++row) {
    Eigen::VectorXd& score =
        scores.emplace(experiment.observations->BlockOfRow(row), Eigen::VectorXd::Zero(p)).first->second;
    score += left[row] * fit.columns.values.row(row).tail(p).transpose();
  }
  Eigen::MatrixXd meat = Eigen::MatrixXd::Zero(p, p);
  for (const auto& [block, score] : scores) meat += score * score.transpose();
  const double blocks = static_cast<double>(scores.size());
  // Each value leaves one block less to judge it by.
  meat *= blocks / std::max(blocks - p, 1.0);
  const double variance = fit.sigma * fit.sigma;
  Eigen::MatrixXd between = fit.covariance * meat * fit.covariance / (variance * variance);
  // Few blocks know little of many values: of each value the larger variance, with the fit's correlations.
  Eigen::MatrixXd covariance = fit.covariance;
  for (int i = 0; i < p; ++i) {
    if (!(fit.covariance(i, i) > 0)) continue;
    const double factor = std::sqrt(std::max(between(i, i) / fit.covariance(i, i), 1.0));
    covariance.row(i) *= factor;
    covariance.col(i) *= factor;
  }
  return covariance;
}

}  // namespace touchstone::diagnosis::images
