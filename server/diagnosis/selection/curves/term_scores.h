// Scores of columns that a fit might be extended by, from inner products alone.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "server/diagnosis/engine/fit/fit.h"

namespace touchstone::diagnosis::selection {

// Gains of blocks of columns, one per block.
struct TermScores {
  std::vector<double> log_evidence, log_ratio;  // over the fit; nats, and log of the likelihoods' ratio
  Eigen::MatrixXd step;                         // width x blocks: best values
};

// Scores further columns against a fit, under every hypothesis of the surface: a term may take the surface's place.
// `experiment` and `fit` must outlive it.
class TermScorer {
 public:
  TermScorer(const engine::Experiment& experiment, const engine::Fit& fit);

  // Blocks of `width` (1 or 2) columns. `scales`: of each column's value, the width of its prior.
  TermScores Score(const Eigen::MatrixXd& columns, int width, const std::vector<double>& scales) const;

 private:
  // Inner products under one hypothesis, and what the fit's own columns explain of each.
  struct Projection {
    Eigen::MatrixXd cross;      // [residual, own columns] x columns
    Eigen::VectorXd norms;      // of the columns
    Eigen::VectorXd inner;      // of the two columns of each block, if there are two
    Eigen::VectorXd own_step;   // of the fit's parameters, without any term
    Eigen::MatrixXd own_cross;  // of the fit's parameters, per column
    double q = 0;               // squared residual beyond the fit's own columns
  };
  struct BlockFit {
    bool determined = false;  // false: the fit has such a column already
    double log_likelihood = 0, log_evidence = 0;
    Eigen::VectorXd step;
  };

  Projection Project(const engine::Likelihood::Columns& prepared, int width, int s) const;
  BlockFit FitBlock(const Projection& projection, int b, int width, const std::vector<double>& scales,
                    int s) const;

  const engine::Likelihood& likelihood_;
  const engine::Fit& fit_;
  double base_log_ = 0;  // log likelihood of the fit without a term: scale of the sums
};

}  // namespace touchstone::diagnosis::selection
