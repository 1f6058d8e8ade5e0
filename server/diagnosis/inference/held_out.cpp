#include "server/diagnosis/inference/held_out.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

namespace touchstone::diagnosis::inference {
namespace {

constexpr int kFolds = 5;  // of blocks

// The rows of each part that is left out.
std::vector<std::vector<int>> FoldsOf(const ObservationModel& observations, bool by_group) {
  std::vector<std::vector<int>> folds(by_group ? observations.groups().size() : kFolds);
  for (int row = 0; row < observations.rows(); ++row)
    folds[by_group ? observations.GroupOfRow(row) : observations.BlockOfRow(row) % kFolds].push_back(row);
  return folds;
}

// The least squares step within the parameters' bounds: what runs out of them is held there.
Eigen::VectorXd BoundedStep(const Eigen::MatrixXd& inner, const Eigen::VectorXd& target, const Fit& fit) {
  const int p = fit.model.size();
  Eigen::VectorXd step = Eigen::VectorXd::Zero(p);
  std::vector<int> free(p);
  for (int i = 0; i < p; ++i) free[i] = i;
  while (!free.empty()) {
    const int n = static_cast<int>(free.size());
    Eigen::MatrixXd a(n, n);
    Eigen::VectorXd b(n);
    const Eigen::VectorXd left = target - inner * step;  // what is held at a bound has moved already
    for (int i = 0; i < n; ++i) {
      b[i] = left[free[i]];
      for (int j = 0; j < n; ++j) a(i, j) = inner(free[i], free[j]);
    }
    const Eigen::VectorXd x = a.ldlt().solve(b);
    int out = -1;
    for (int i = 0; i < n && out < 0; ++i) {
      const FreeParameter& c = fit.model.parameters()[free[i]];
      const double to = fit.point[free[i]] + x[i], slack = 1e-12 * (std::abs(c.upper) + std::abs(c.lower));
      if (to >= c.lower - slack && to <= c.upper + slack) continue;
      out = i;
      step[free[i]] = (to < c.lower ? c.lower : c.upper) - fit.point[free[i]];
    }
    if (out >= 0) {
      free.erase(free.begin() + out);
      continue;
    }
    for (int i = 0; i < n; ++i) step[free[i]] = x[i];
    break;
  }
  return step;
}

double HeldOutIn(const std::vector<std::vector<int>>& folds, const Fit& fit) {
  const Eigen::MatrixXd& columns = fit.columns.values;
  const int n = static_cast<int>(columns.rows()), p = fit.model.size();
  if (n == 0) return 0;
  const Eigen::VectorXd r = columns.col(0);
  if (p == 0) return std::sqrt(r.squaredNorm() / n);

  const Eigen::MatrixXd j = columns.rightCols(p);
  Eigen::MatrixXd all = j.transpose() * j;
  const Eigen::VectorXd target = j.transpose() * r;
  const double variance = r.squaredNorm() / n;
  for (int i = 0; i < p; ++i) {
    const double scale = fit.model.parameters()[i].scale;
    all(i, i) += variance / (scale * scale);  // what the other rows leave open stays where it is
  }
  double sum = 0;
  for (const std::vector<int>& fold : folds) {
    if (fold.empty()) continue;
    Eigen::MatrixXd jf(fold.size(), p);
    Eigen::VectorXd rf(fold.size());
    for (size_t k = 0; k < fold.size(); ++k) jf.row(k) = j.row(fold[k]), rf[k] = r[fold[k]];
    const Eigen::VectorXd step = BoundedStep(all - jf.transpose() * jf, target - jf.transpose() * rf, fit);
    sum += (rf - jf * step).squaredNorm();
  }
  return std::sqrt(sum / n);
}

}  // namespace

double HeldOutRmse(const Experiment& experiment, const Fit& fit) {
  const bool own_values = std::any_of(fit.model.parameters().begin(), fit.model.parameters().end(),
                                      [](const FreeParameter& c) { return !c.object.empty(); });
  const bool by_group = experiment.observations->groups().size() >= 3 && !own_values;
  return HeldOutIn(FoldsOf(*experiment.observations, by_group), fit);
}

double HeldOutRmseByBlock(const Experiment& experiment, const Fit& fit) {
  return HeldOutIn(FoldsOf(*experiment.observations, false), fit);
}

}  // namespace touchstone::diagnosis::inference
