#include "server/diagnosis/engine/fit/laplace_evidence.h"

#include <algorithm>
#include <cmath>

#include "server/base/numbers/decompositions.h"
#include "server/diagnosis/engine/fit/rules.h"

namespace touchstone::diagnosis::engine {
namespace {

// The minimum of the quadratic form within bounds, by holding parameters that run out of them there.
struct Minimum {
  Eigen::VectorXd step;
  std::vector<int> free;  // parameters that are not held at a bound
  double q = 0;
};

Minimum Minimise(const Eigen::MatrixXd& gram, const std::vector<int>& members,
                 const std::vector<FreeParameter>& parameters, const Eigen::VectorXd& point,
                 double sigma_squared) {
  const int p = static_cast<int>(members.size()) - 1;
  Minimum m;
  m.step = Eigen::VectorXd::Zero(p);
  for (int i = 0; i < p; ++i) m.free.push_back(i);
  const int r = members[0];
  for (;;) {
    const int n = static_cast<int>(m.free.size());
    if (n == 0) break;
    Eigen::MatrixXd a(n, n);
    Eigen::VectorXd b(n);
    for (int i = 0; i < n; ++i) {
      const int ci = members[1 + m.free[i]];
      b[i] = gram(ci, r);
      // What is held at a bound has moved already.
      for (int j = 0; j < p; ++j)
        if (m.step[j] != 0 && std::find(m.free.begin(), m.free.end(), j) == m.free.end())
          b[i] -= gram(ci, members[1 + j]) * m.step[j];
      for (int j = 0; j < n; ++j) a(i, j) = gram(ci, members[1 + m.free[j]]);
      const double scale = parameters[m.free[i]].scale;
      a(i, i) += kFitRules.ridge * sigma_squared / (scale * scale) + 1e-300;
    }
    const Eigen::VectorXd x = SymmetricSolver(a).Solve(b);
    int out = -1;
    double bound_step = 0;
    for (int i = 0; i < n && out < 0; ++i) {
      const FreeParameter& c = parameters[m.free[i]];
      const double to = point[m.free[i]] + x[i];
      const double slack = 1e-12 * (std::abs(c.upper) + std::abs(c.lower));
      if (to < c.lower - slack) out = i, bound_step = c.lower - point[m.free[i]];
      if (to > c.upper + slack) out = i, bound_step = c.upper - point[m.free[i]];
    }
    if (out < 0) {
      for (int i = 0; i < n; ++i) m.step[m.free[i]] = x[i];
      break;
    }
    m.step[m.free[out]] = bound_step;
    m.free.erase(m.free.begin() + out);
  }
  m.q = gram(r, r);
  for (int i = 0; i < p; ++i) {
    if (m.step[i] == 0) continue;
    m.q -= 2 * m.step[i] * gram(members[1 + i], r);
    for (int j = 0; j < p; ++j) m.q += m.step[i] * m.step[j] * gram(members[1 + i], members[1 + j]);
  }
  return m;
}

// Inverse variances of the free parameters over their squared scales: the information that the data hold.
Eigen::MatrixXd ScaledInformation(const Eigen::MatrixXd& gram, const std::vector<int>& members,
                                  const std::vector<FreeParameter>& parameters, const std::vector<int>& free,
                                  double sigma) {
  const int n = static_cast<int>(free.size());
  Eigen::MatrixXd information(n, n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      information(i, j) = gram(members[1 + free[i]], members[1 + free[j]]) *
                          (parameters[free[i]].scale * parameters[free[j]].scale / (sigma * sigma));
  return information;
}

// Occam's factor: how much of the prior's volume the data rule out, nats. Every direction that can be seen costs the
// same, as if the prior were worth one observation: the sizes that rigs usually show must not decide between two weak
// causes. What cannot be seen costs nothing.
double OccamNats(const Eigen::MatrixXd& information, int rows) {
  double occam = 0;
  if (information.rows() == 0) return occam;
  const Eigen::VectorXd eigenvalues = EigenvaluesOfSymmetric(information);
  for (int i = 0; i < information.rows(); ++i) {
    const double seen = std::max(eigenvalues[i], 0.0);
    occam += 0.5 * std::log1p(rows * seen / (seen + kFitRules.visible));
  }
  return occam;
}

// Of all parameters; zero for those that are held at a bound.
Eigen::MatrixXd CovarianceOf(const Eigen::MatrixXd& information, const std::vector<FreeParameter>& parameters,
                             const std::vector<int>& free, int size) {
  const int n = static_cast<int>(free.size());
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(size, size);
  Eigen::MatrixXd ridged(n, n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) ridged(i, j) = information(i, j) + (i == j ? kFitRules.ridge.value() : 0);
  const Eigen::MatrixXd inverse = SymmetricSolver(ridged).SolveColumns(Eigen::MatrixXd::Identity(n, n));
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      covariance(free[i], free[j]) = inverse(i, j) * parameters[free[i]].scale * parameters[free[j]].scale;
  return covariance;
}

}  // namespace

double LogSum(const std::vector<double>& logs) {
  if (logs.empty()) return -INFINITY;
  const double max = *std::max_element(logs.begin(), logs.end());
  if (!std::isfinite(max)) return max;
  double sum = 0;
  for (const double value : logs) sum += std::exp(value - max);
  return max + std::log(sum);
}

double LogPriorOfValues(const std::vector<FreeParameter>& parameters, const Eigen::VectorXd& point) {
  double sum = 0;
  for (size_t i = 0; i < parameters.size(); ++i) {
    const double value = point[static_cast<int>(i)];
    if (value < parameters[i].usual_lower || value > parameters[i].usual_upper) sum -= kFitRules.unusual_nats;
    const double x = (value - parameters[i].neutral) / (kFitRules.prior_width * parameters[i].scale);
    sum += parameters[i].log_prior - std::log1p(x * x);
  }
  return sum;
}

std::vector<Eigen::MatrixXd> Grams(const Likelihood& likelihood, const Likelihood::Columns& columns) {
  std::vector<Eigen::MatrixXd> grams;
  for (int s = 0; s < static_cast<int>(likelihood.hypotheses().size()); ++s)
    grams.push_back(likelihood.Gram(columns, s));
  return grams;
}

LaplaceEvidence ComputeLaplaceEvidence(const Likelihood& likelihood,
                                       const std::vector<Eigen::MatrixXd>& grams,
                                       const std::vector<int>& members,
                                       const std::vector<FreeParameter>& parameters,
                                       const Eigen::VectorXd& point) {
  const int p = static_cast<int>(members.size()) - 1;
  LaplaceEvidence best;
  double best_log = -INFINITY;
  std::vector<double> log_likelihoods, log_evidences;
  for (int s = 0; s < static_cast<int>(grams.size()); ++s) {
    const Eigen::MatrixXd& gram = grams[s];
    if (gram.size() == 0) continue;
    const double sigma0 = likelihood.Sigma(gram(members[0], members[0]), 0);
    const Minimum m = Minimise(gram, members, parameters, point, sigma0 * sigma0);
    const double sigma = likelihood.Sigma(m.q, static_cast<int>(m.free.size()));
    const double log_likelihood = likelihood.LogPrior(s) + likelihood.LogLikelihood(m.q, s);
    const Eigen::MatrixXd information = ScaledInformation(gram, members, parameters, m.free, sigma);
    const double log_evidence = log_likelihood - OccamNats(information, likelihood.rows()) +
                                LogPriorOfValues(parameters, point + m.step);
    log_likelihoods.push_back(log_likelihood);
    log_evidences.push_back(log_evidence);
    if (log_evidence <= best_log && s > 0) continue;
    best_log = log_evidence;
    best.hypothesis = s;
    best.sigma = sigma;
    best.step = m.step;
    best.covariance = CovarianceOf(information, parameters, m.free, p);
  }
  best.log_likelihood = LogSum(log_likelihoods);
  best.log_evidence = LogSum(log_evidences);
  return best;
}

}  // namespace touchstone::diagnosis::engine
