#include "server/diagnosis/inference/held_out.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

namespace touchstone::diagnosis::inference {
namespace {

constexpr int kFolds = 5;  // of blocks

// The rows of each part that is left out.
std::vector<std::vector<int>> FoldsOf(const ObservationModel& observations, const Parameterization& model) {
  const bool own_values = std::any_of(model.parameters().begin(), model.parameters().end(),
                                      [](const FreeParameter& c) { return !c.object.empty(); });
  const bool by_group = observations.groups().size() >= 3 && !own_values;
  std::vector<std::vector<int>> folds(by_group ? observations.groups().size() : kFolds);
  for (int row = 0; row < observations.rows(); ++row)
    folds[by_group ? observations.GroupOfRow(row) : observations.BlockOfRow(row) % kFolds].push_back(row);
  return folds;
}

}  // namespace

double HeldOutRmse(const Experiment& experiment, const Fit& fit) {
  const Eigen::MatrixXd& columns = fit.columns.values;
  const int n = static_cast<int>(columns.rows()), p = fit.model.size();
  if (n == 0) return 0;
  const Eigen::VectorXd r = columns.col(0);
  if (p == 0) return std::sqrt(r.squaredNorm() / n);

  const Eigen::MatrixXd j = columns.rightCols(p);
  const Eigen::MatrixXd all = j.transpose() * j;
  const Eigen::VectorXd target = j.transpose() * r;
  const double variance = r.squaredNorm() / n;
  double sum = 0;
  for (const std::vector<int>& fold : FoldsOf(*experiment.observations, fit.model)) {
    if (fold.empty()) continue;
    Eigen::MatrixXd jf(fold.size(), p);
    Eigen::VectorXd rf(fold.size());
    for (size_t k = 0; k < fold.size(); ++k) jf.row(k) = j.row(fold[k]), rf[k] = r[fold[k]];
    Eigen::MatrixXd rest = all - jf.transpose() * jf;
    for (int i = 0; i < p; ++i) {
      const double scale = fit.model.parameters()[i].scale;
      rest(i, i) += variance / (scale * scale);  // what the other rows leave open stays where it is
    }
    const Eigen::VectorXd step = rest.ldlt().solve(target - jf.transpose() * rf);
    sum += (rf - jf * step).squaredNorm();
  }
  return std::sqrt(sum / n);
}

}  // namespace touchstone::diagnosis::inference
