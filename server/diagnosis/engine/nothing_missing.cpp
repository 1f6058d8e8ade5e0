#include "server/diagnosis/engine/nothing_missing.h"

#include <algorithm>
#include <cmath>

#include "server/base/numbers/decompositions.h"
#include "server/base/numbers/distributions.h"

namespace touchstone::diagnosis::engine {

void LinearHypotheses::Add(const Eigen::MatrixXd& columns, int first_row) {
  if (columns.cols() == 0 || !columns.allFinite()) return;
  // Columns of any unit: only their directions count.
  Eigen::MatrixXd scaled = columns;
  for (int j = 0; j < scaled.cols(); ++j)
    if (const double norm = scaled.col(j).norm(); norm > 0) scaled.col(j) /= norm;
  const ColumnSpan span(scaled);
  if (span.rank() == 0 || 2 * span.rank() > columns.rows()) return;
  bases_.push_back({span.Basis(), first_row});
}

Eigen::MatrixXd LinearHypotheses::PValues(const Eigen::MatrixXd& residuals) const {
  Eigen::MatrixXd p_values(size(), residuals.cols());
  const Eigen::RowVectorXd all = residuals.colwise().squaredNorm();
  for (int h = 0; h < size(); ++h) {
    const Basis& basis = bases_[h];
    const Eigen::RowVectorXd taken =
        (basis.columns.transpose() * residuals.middleRows(basis.first_row, basis.columns.rows()))
            .colwise()
            .squaredNorm();
    const double rank = static_cast<double>(basis.columns.cols());
    const double left = static_cast<double>(residuals.rows()) - rank;
    for (int draw = 0; draw < residuals.cols(); ++draw)
      p_values(h, draw) =
          FisherTail(taken[draw] / rank / std::max((all[draw] - taken[draw]) / left, 1e-300), rank, left);
  }
  return p_values;
}

Eigen::MatrixXd PValuesOfStatistics(const Eigen::MatrixXd& statistics) {
  Eigen::MatrixXd p_values = Eigen::MatrixXd::Ones(statistics.rows(), statistics.cols());
  const auto draws = statistics.rightCols(statistics.cols() - 1);
  for (int h = 0; h < statistics.rows(); ++h) {
    const double mean = draws.row(h).mean();
    const double deviation = std::sqrt((draws.row(h).array() - mean).square().mean());
    if (!(deviation > 0)) continue;
    for (int draw = 0; draw < statistics.cols(); ++draw)
      p_values(h, draw) = std::erfc(std::abs(statistics(h, draw) - mean) / deviation / std::sqrt(2.0));
  }
  return p_values;
}

NothingMissing WorstOfAll(const Eigen::MatrixXd& p_values) {
  NothingMissing worst;
  worst.hypotheses = static_cast<int>(p_values.rows());
  if (worst.hypotheses == 0 || p_values.cols() < 2) return worst;
  const Eigen::RowVectorXd least = p_values.colwise().minCoeff();
  const auto as_bad = (least.rightCols(least.size() - 1).array() <= least[0]).count();
  worst.p = (1.0 + static_cast<double>(as_bad)) / static_cast<double>(least.size());
  // Beyond all draws: what each hypothesis by itself allows, paid for all of them.
  if (as_bad == 0) worst.p = std::min(worst.p, worst.hypotheses * least[0]);
  return worst;
}

}  // namespace touchstone::diagnosis::engine
