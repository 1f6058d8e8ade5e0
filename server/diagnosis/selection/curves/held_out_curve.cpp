#include "server/diagnosis/selection/curves/held_out_curve.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "server/base/numbers/decompositions.h"
#include "server/diagnosis/selection/curves/rules.h"

namespace touchstone::diagnosis::selection {
namespace {

int FoldOf(const engine::Experiment& experiment, const touches::TouchObservationModel& touches, int row,
           bool of_time) {
  if (!of_time) return experiment.observations->BlockOfRow(row) % kCurveRules.folds;
  const int k = touches.contrasts().touches()[touches.contrasts().touch_of_row()[row]];
  return static_cast<int>(static_cast<int64_t>(k) * kCurveRules.fold_stretches /
                          std::max(touches.observations().size(), 1)) %
         kCurveRules.folds;
}

}  // namespace

double HeldOutBeside(const engine::Experiment& experiment, const touches::TouchObservationModel& touches,
                     const engine::Fit& fit, const Eigen::MatrixXd& basis, const Eigen::MatrixXd& precision,
                     bool of_time) {
  const int p = fit.model.size(), m = static_cast<int>(basis.cols()), n = touches.rows();
  Eigen::MatrixXd x(n, p + m);
  x.leftCols(p) = fit.columns.values.middleCols(1, p);
  if (m > 0) x.rightCols(m) = basis;
  const Eigen::VectorXd r = fit.columns.values.col(0);
  Eigen::MatrixXd penalty = Eigen::MatrixXd::Zero(p + m, p + m);
  for (int i = 0; i < p; ++i) penalty(i, i) = std::pow(fit.sigma / fit.model.parameters()[i].scale, 2);
  if (m > 0) penalty.bottomRightCorner(m, m) = precision;
  const Eigen::MatrixXd whole = x.transpose() * x + penalty;
  const Eigen::VectorXd whole_r = x.transpose() * r;
  double squares = 0;
  for (int fold = 0; fold < kCurveRules.folds; ++fold) {
    std::vector<int> out;
    for (int row = 0; row < n; ++row)
      if (FoldOf(experiment, touches, row, of_time) == fold) out.push_back(row);
    Eigen::MatrixXd xo(out.size(), p + m);
    Eigen::VectorXd ro(out.size());
    for (size_t j = 0; j < out.size(); ++j) xo.row(j) = x.row(out[j]), ro[j] = r[out[j]];
    if (p + m > 0) {
      const Eigen::MatrixXd kept = whole - xo.transpose() * xo;
      ro -= xo * SymmetricSolver(kept).Solve(whole_r - xo.transpose() * ro);
    }
    squares += ro.squaredNorm();
  }
  return std::sqrt(squares / std::max(n, 1));
}

}  // namespace touchstone::diagnosis::selection
