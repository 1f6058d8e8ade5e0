#include "server/diagnosis/engine/fit/resampled_covariance.h"

#include <algorithm>
#include <map>
#include <vector>

#include "server/base/numbers/decompositions.h"
#include "server/base/numbers/random.h"
#include "server/diagnosis/engine/fit/rules.h"

namespace touchstone::diagnosis::engine {
namespace {

// Normal equations of one block.
struct BlockEquations {
  Eigen::MatrixXd left;
  Eigen::VectorXd right;
};

std::vector<BlockEquations> EquationsByBlock(const ObservationModel& observations, const Fit& fit) {
  std::map<int, std::vector<int>> rows_of_block;
  for (int row = 0; row < observations.rows(); ++row)
    rows_of_block[observations.BlockOfRow(row)].push_back(row);
  std::vector<BlockEquations> equations;
  for (const auto& [block, rows] : rows_of_block) {
    Eigen::MatrixXd columns(rows.size(), fit.columns.values.cols());
    for (size_t k = 0; k < rows.size(); ++k)
      columns.row(static_cast<Eigen::Index>(k)) = fit.columns.values.row(rows[k]);
    const auto derivatives = columns.rightCols(fit.model.size());
    equations.push_back({derivatives.transpose() * derivatives, derivatives.transpose() * columns.col(0)});
  }
  return equations;
}

}  // namespace

Eigen::MatrixXd ResampledCovariance(const Experiment& experiment, const Fit& fit, uint64_t seed) {
  const std::vector<BlockEquations> blocks = EquationsByBlock(*experiment.observations, fit);
  const int size = fit.model.size();
  std::vector<Eigen::VectorXd> steps;
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(size);
  for (int draw = 0; draw < kFitRules.resamples; ++draw) {
    RandomStream random(seed, RandomDomain::kDiagnosis, static_cast<uint64_t>(draw));
    std::vector<int> times(blocks.size(), 0);
    for (size_t k = 0; k < blocks.size(); ++k) ++times[random.Below(blocks.size())];
    if (std::count_if(times.begin(), times.end(), [](int n) { return n > 0; }) <
        kFitRules.min_distinct_blocks)
      continue;
    Eigen::MatrixXd left = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(size);
    for (size_t k = 0; k < blocks.size(); ++k)
      left += times[k] * blocks[k].left, right += times[k] * blocks[k].right;
    steps.push_back(SymmetricSolver(left).Solve(right));
    mean += steps.back();
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(size, size);
  if (steps.size() < 2) return covariance;
  const double count = static_cast<double>(steps.size());
  for (const Eigen::VectorXd& step : steps)
    covariance += (step - mean / count) * (step - mean / count).transpose() / (count - 1);
  return covariance;
}

}  // namespace touchstone::diagnosis::engine
