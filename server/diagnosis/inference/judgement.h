// The evidence for values of effects, from inner products alone: no pass over the data.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "server/diagnosis/inference/free_model.h"
#include "server/diagnosis/inference/likelihood.h"

namespace touchstone {

// What the data say of one model with free values.
struct Judgement {
  double evidence = 0;
  double log_likelihood = 0;
  int surface = 0;
  double sigma_s = 0;
  Eigen::VectorXd step;  // to the optimum of the most probable hypothesis
  Eigen::MatrixXd covariance;
};

// Evidence of coordinates whose columns follow the residual in grams[s] (any subset: `members`, with the
// residual at 0). Values are held within bounds. `point`: where the columns were taken.
Judgement Judge(const Likelihood& likelihood, const std::vector<Eigen::MatrixXd>& grams,
                const std::vector<int>& members, const std::vector<Coordinate>& coordinates,
                const Eigen::VectorXd& point);

// The Gram matrices of columns under every hypothesis.
std::vector<Eigen::MatrixXd> Grams(const Likelihood& likelihood, const Likelihood::Columns& columns);

// What the prior says of values: Cauchy round what changes nothing, ten times as wide as rigs usually show.
double LogPriorOfValues(const std::vector<Coordinate>& coordinates, const Eigen::VectorXd& point);

}  // namespace touchstone
