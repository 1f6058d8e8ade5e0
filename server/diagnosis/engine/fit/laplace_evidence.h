// The evidence for a model with free parameters by Laplace's approximation, from inner products alone: no pass over
// the data.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "server/diagnosis/engine/fit/likelihood.h"
#include "server/diagnosis/engine/fit/parameterization.h"

namespace touchstone::diagnosis::engine {

// What the data say of one model with free parameters. Logs in nats, comparable between models of one set of rows.
struct LaplaceEvidence {
  double log_evidence = 0;
  double log_likelihood = 0;   // maximum over the parameters, averaged over hypotheses of the smooth error
  int hypothesis = 0;          // the most probable one
  double sigma = 0;            // noise under it, in the unit of the rows
  Eigen::VectorXd step;        // from the point to its optimum
  Eigen::MatrixXd covariance;  // of the parameters; zero where one is held at a bound
};

// `grams`: inner products of the residual and of derivative columns, by hypothesis (empty: it is left out); `members`: which of them are
// the residual (first) and the derivatives by `parameters`. Values are held within bounds. `point`: where the
// columns were taken.
LaplaceEvidence ComputeLaplaceEvidence(const Likelihood& likelihood,
                                       const std::vector<Eigen::MatrixXd>& grams,
                                       const std::vector<int>& members,
                                       const std::vector<FreeParameter>& parameters,
                                       const Eigen::VectorXd& point);

// The Gram matrices of columns under every hypothesis.
std::vector<Eigen::MatrixXd> Grams(const Likelihood& likelihood, const Likelihood::Columns& columns);

// The log of the sum of exp(logs), however large or small they are; -inf for none.
double LogSum(const std::vector<double>& logs);

// What the prior says of values: Cauchy round what changes nothing, ten times as wide as rigs usually show; and of the
// choice of an object.
double LogPriorOfValues(const std::vector<FreeParameter>& parameters, const Eigen::VectorXd& point);

}  // namespace touchstone::diagnosis::engine
