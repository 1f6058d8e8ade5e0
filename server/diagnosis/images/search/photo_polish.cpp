// Values from every photograph, near where a search found them, and how sure they are.
#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/status.h"
#include "server/diagnosis/images/search/photo_quality.h"
#include "server/diagnosis/images/search/photo_search.h"
#include "server/diagnosis/images/search/rules.h"

namespace touchstone::diagnosis::images {
absl::StatusOr<PolishRows> MakePolishRows(const Photographs& photographs, const engine::Fit& fit,
                                          const DiagnosisContext& context) {
  const model::Model& anchor = fit.model.base();
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> expected,
                              ExpectPhotographs(photographs, anchor, false, context.pool));
  PhotoRowsOptions options;
  options.cells = kPhotoSearchRules.fine_cells;
  options.smoothing = kPhotoSearchRules.fine_smoothing;
  options.max_photographs = kPhotoSearchRules.polish_photographs;
  options.contour_px2 = ContourPlaceVariance(photographs, expected, context.pool);
  PolishRows made;
  TOUCHSTONE_ASSIGN_OR_RETURN(made.search, MakePhotoSearch(photographs, anchor, {}, options, context));
  made.experiment = *made.search.experiment;
  if (fit.hypothesis != 0) return made;
  made.plain = std::make_unique<engine::Likelihood>(made.search.rows->GroupRows(), nullptr, 0, nullptr);
  made.plain->SetLeastNoise(1);
  made.experiment.likelihood = made.plain.get();
  return made;
}

absl::Status PolishExplanation(const Photographs& photographs, const DiagnosisContext& context,
                               PhotoSelection* selection) {
  selection->polished = selection->fit;
  selection->covariance = selection->fit.covariance;
  if (selection->fit.model.size() == 0) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const PolishRows all, MakePolishRows(photographs, selection->fit, context));
  TOUCHSTONE_ASSIGN_OR_RETURN(selection->polished, engine::FitModel(all.experiment, selection->fit.model));
  selection->covariance = CovarianceBetweenBlocks(all.experiment, selection->polished);
  return absl::OkStatus();
}

Eigen::MatrixXd CovarianceBetweenBlocks(const engine::Experiment& experiment, const engine::Fit& fit) {
  const int p = fit.model.size(), n = experiment.observations->rows();
  if (p == 0) return fit.covariance;
  const Eigen::VectorXd left =
      fit.columns.values.col(0) -
      experiment.likelihood->FieldMean(engine::Likelihood::Pick(fit.columns, {0}), fit.hypothesis);
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
