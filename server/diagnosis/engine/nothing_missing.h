// One number over all that was tried: how often data of the given model look as bad as these in the worst of all hypotheses.
// Each hypothesis gives a p value for the data and for draws from the given model; the least of each draw is compared with the
// least of the data (Westfall and Young's min-P), so that hypotheses may depend on one another in any way.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace touchstone::diagnosis::engine {

// Further columns that would explain rows: an effect's derivatives, the hats of a curve.
class LinearHypotheses {
 public:
  // `columns`: rows `first_row` .. of the data, which may be all of them. Of no rank: not tried.
  void Add(const Eigen::MatrixXd& columns, int first_row = 0);
  int size() const { return static_cast<int>(bases_.size()); }

  // p value of each hypothesis (rows) for each draw (columns of `residuals`): F test of what the columns take off.
  Eigen::MatrixXd PValues(const Eigen::MatrixXd& residuals) const;

 private:
  struct Basis {
    Eigen::MatrixXd columns;  // orthonormal
    int first_row = 0;
  };
  std::vector<Basis> bases_;
};

// p values of statistics (hypotheses x draws, in any unit) of which draws 1, 2, ... show mean and spread: either tail.
Eigen::MatrixXd PValuesOfStatistics(const Eigen::MatrixXd& statistics);

struct NothingMissing {
  double p =
      1;  // 0 to 1; from draws at least 1 / (draws + 1), or the least p value times the hypotheses where that is less
  int hypotheses = 0;
};
// `p_values`: hypotheses x draws; column 0 has those of the data.
NothingMissing WorstOfAll(const Eigen::MatrixXd& p_values);

}  // namespace touchstone::diagnosis::engine
