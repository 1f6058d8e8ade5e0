#include "server/diagnosis/inference/judgement.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

namespace touchstone {
namespace {

constexpr double kSeen = 10;        // squared scale over standard error from where a direction counts as seen
constexpr double kPriorWidth = 10;  // of a value's prior (Cauchy) over the size that rigs show
constexpr double kRidge = 1e-4;     // prior precision over 1 / scale^2: holds what nothing determines

// Sum of logs, without overflow.
double LogSum(const std::vector<double>& logs) {
  const double most = *std::max_element(logs.begin(), logs.end());
  double sum = 0;
  for (const double value : logs) sum += std::exp(value - most);
  return most + std::log(sum);
}

// The minimum of the quadratic form within bounds, by giving up coordinates that run out of them.
struct Minimum {
  Eigen::VectorXd step;
  std::vector<int> free;  // coordinates that are not held at a bound
  double q = 0;
};

Minimum Minimise(const Eigen::MatrixXd& gram, const std::vector<int>& members,
                 const std::vector<Coordinate>& coordinates, const Eigen::VectorXd& point,
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
      const double scale = coordinates[m.free[i]].scale;
      a(i, i) += kRidge * sigma_squared / (scale * scale) + 1e-300;
    }
    const Eigen::VectorXd x = a.ldlt().solve(b);
    int out = -1;
    double bound_step = 0;
    for (int i = 0; i < n && out < 0; ++i) {
      const Coordinate& c = coordinates[m.free[i]];
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

}  // namespace

double LogPriorOfValues(const std::vector<Coordinate>& coordinates, const Eigen::VectorXd& point) {
  double sum = 0;
  for (size_t i = 0; i < coordinates.size(); ++i) {
    const double x =
        (point[static_cast<int>(i)] - coordinates[i].neutral) / (kPriorWidth * coordinates[i].scale);
    sum -= std::log1p(x * x);
  }
  return sum;
}

std::vector<Eigen::MatrixXd> Grams(const Likelihood& likelihood, const Likelihood::Columns& columns) {
  std::vector<Eigen::MatrixXd> grams;
  for (int s = 0; s < static_cast<int>(likelihood.surfaces().size()); ++s)
    grams.push_back(likelihood.Gram(columns, s));
  return grams;
}

Judgement Judge(const Likelihood& likelihood, const std::vector<Eigen::MatrixXd>& grams,
                const std::vector<int>& members, const std::vector<Coordinate>& coordinates,
                const Eigen::VectorXd& point) {
  const int p = static_cast<int>(members.size()) - 1;
  Judgement best;
  double best_log = -INFINITY;
  std::vector<double> logs, evidences;
  for (int s = 0; s < static_cast<int>(grams.size()); ++s) {
    const Eigen::MatrixXd& gram = grams[s];
    const double sigma0 = likelihood.Sigma(gram(members[0], members[0]), 0);
    const Minimum m = Minimise(gram, members, coordinates, point, sigma0 * sigma0);
    const double sigma = likelihood.Sigma(m.q, static_cast<int>(m.free.size()));
    const double log_likelihood = likelihood.LogPrior(s) + likelihood.LogLikelihood(m.q, s);

    // Occam's factor: how much of the prior's volume the data rule out.
    const int n = static_cast<int>(m.free.size());
    Eigen::MatrixXd information(n, n);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        information(i, j) = gram(members[1 + m.free[i]], members[1 + m.free[j]]) *
                            (coordinates[m.free[i]].scale * coordinates[m.free[j]].scale / (sigma * sigma));
    // Every direction that can be seen costs the same, as if the prior were worth one observation: the sizes
    // that rigs usually show must not decide between two weak causes. What cannot be seen costs nothing.
    double occam = 0;
    if (n > 0) {
      const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(information, Eigen::EigenvaluesOnly);
      for (int i = 0; i < n; ++i) {
        const double seen = std::max(eigen.eigenvalues()[i], 0.0);
        occam += 0.5 * std::log1p(likelihood.rows() * seen / (seen + kSeen));
      }
    }
    const double evidence = log_likelihood - occam + LogPriorOfValues(coordinates, point + m.step);
    logs.push_back(log_likelihood);
    evidences.push_back(evidence);
    if (evidence <= best_log && s > 0) continue;
    best_log = evidence;
    best.surface = s;
    best.sigma_s = sigma;
    best.step = m.step;
    best.covariance = Eigen::MatrixXd::Zero(p, p);
    Eigen::MatrixXd plain(n, n);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) plain(i, j) = information(i, j) + (i == j ? kRidge : 0);
    const Eigen::MatrixXd inverse = plain.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        best.covariance(m.free[i], m.free[j]) =
            inverse(i, j) * coordinates[m.free[i]].scale * coordinates[m.free[j]].scale;
  }
  best.log_likelihood = LogSum(logs);
  best.evidence = LogSum(evidences);
  return best;
}

}  // namespace touchstone
