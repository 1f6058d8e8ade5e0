#include "server/diagnosis/selection/session/partial_offset.h"

#include <absl/strings/str_format.h>

#include <Eigen/Core>

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

#include "server/base/text/readable_time.h"
#include "server/diagnosis/selection/session/rules.h"
#include "server/model/finger_name.h"

namespace touchstone::diagnosis::selection {
namespace {

// Complete touches, as orthonormal contrasts of their fingers.
struct Cloud {
  std::vector<int> touch;
  Eigen::MatrixXd y;      // contrasts x touches
  Eigen::MatrixXd basis;  // contrasts x fingers
};

Cloud CloudOf(const touches::Observations& o, const std::vector<double>& residuals) {
  Cloud cloud;
  cloud.basis = Eigen::MatrixXd::Zero(o.fingers - 1, o.fingers);
  for (int row = 1; row < o.fingers; ++row) {
    const double norm = std::sqrt(row * (row + 1.0));
    for (int i = 0; i < row; ++i) cloud.basis(row - 1, i) = -1 / norm;
    cloud.basis(row - 1, row) = row / norm;
  }
  for (int k = 0; k < o.size(); ++k) {
    const double* r = &residuals[static_cast<size_t>(k) * o.fingers];
    if (o.used[k] && std::none_of(r, r + o.fingers, [](double x) { return std::isnan(x); }))
      cloud.touch.push_back(k);
  }
  cloud.y.resize(o.fingers - 1, static_cast<long>(cloud.touch.size()));
  for (size_t t = 0; t < cloud.touch.size(); ++t)
    cloud.y.col(static_cast<long>(t)) =
        cloud.basis * Eigen::Map<const Eigen::VectorXd>(
                          &residuals[static_cast<size_t>(cloud.touch[t]) * o.fingers], o.fingers);
  return cloud;
}

// The touches with unit covariance, and the log of the volume's change, which likelihoods of them lack: a finger that
// scatters more than the others makes a cloud long, and not two clouds.
std::pair<Eigen::MatrixXd, double> Whitened(const Eigen::MatrixXd& y) {
  const Eigen::MatrixXd apart = y.colwise() - y.rowwise().mean().eval();
  const Eigen::LLT<Eigen::MatrixXd> root(apart * apart.transpose() / static_cast<double>(y.cols()));
  if (root.info() != Eigen::Success) return {y, 0};
  const Eigen::MatrixXd lower = root.matrixL();
  return {lower.triangularView<Eigen::Lower>().solve(y),
          -static_cast<double>(y.cols()) * lower.diagonal().array().log().sum()};
}

double GaussianLogLikelihood(const Eigen::MatrixXd& y) {
  const Eigen::MatrixXd apart = y.colwise() - y.rowwise().mean().eval();
  const double count = static_cast<double>(y.size());
  return -0.5 * count * (std::log(2 * M_PI * apart.squaredNorm() / count) + 1);
}

// The best Student distribution with one scale, its tails from a grid (EM).
double StudentLogLikelihood(const Eigen::MatrixXd& y) {
  const long n = y.cols();
  const double f = static_cast<double>(y.rows());
  double best = -INFINITY;
  for (double tails = 2; tails < kSessionRules.no_tails; tails *= 1.6) {
    Eigen::VectorXd mean = y.rowwise().mean();
    double scale2 = (y.colwise() - mean).squaredNorm() / static_cast<double>(y.size());
    Eigen::ArrayXd squares;
    for (int iteration = 0; iteration < 30; ++iteration) {
      squares = (y.colwise() - mean).colwise().squaredNorm().array() / scale2;
      const Eigen::ArrayXd weights = (tails + f) / (tails + squares);
      mean = (y * weights.matrix()) / weights.sum();
      scale2 = ((y.colwise() - mean).colwise().squaredNorm().array().transpose() * weights).sum() /
               static_cast<double>(y.size());
    }
    squares = (y.colwise() - mean).colwise().squaredNorm().array() / scale2;
    const double constant =
        std::lgamma(0.5 * (tails + f)) - std::lgamma(0.5 * tails) - 0.5 * f * std::log(M_PI * tails * scale2);
    best = std::max(best,
                    static_cast<double>(n) * constant - 0.5 * (tails + f) * (squares / tails).log1p().sum());
  }
  return best;
}

struct Mixture {
  double log_likelihood = -INFINITY, share = 0, variance = 0;
  Eigen::VectorXd mean, offset;
  Eigen::ArrayXd has;  // probability that a touch has the offset
};

Mixture FitMixture(const Eigen::MatrixXd& y, const Eigen::VectorXd& start) {
  const double count = static_cast<double>(y.size());
  Mixture m;
  m.mean = y.rowwise().mean() - 0.3 * start;
  m.offset = start, m.share = 0.3;
  m.variance = (y.colwise() - y.rowwise().mean().eval()).squaredNorm() / count;
  for (int iteration = 0; iteration < kSessionRules.offset_steps; ++iteration) {
    const Eigen::ArrayXd without = (y.colwise() - m.mean).colwise().squaredNorm().array() / m.variance;
    const Eigen::ArrayXd with =
        (y.colwise() - (m.mean + m.offset)).colwise().squaredNorm().array() / m.variance;
    const Eigen::ArrayXd odds = 0.5 * (without - with) + std::log(m.share / (1 - m.share));
    m.has = 1 / (1 + (-odds).exp());
    // log(sum of both) = log of the one without, and what the other adds to it.
    const Eigen::ArrayXd added = odds.max(0) + (-odds.abs()).exp().log1p();
    m.log_likelihood = -0.5 * count * std::log(2 * M_PI * m.variance) - 0.5 * without.sum() +
                       static_cast<double>(y.cols()) * std::log(1 - m.share) + added.sum();
    const double some = std::clamp(m.has.sum(), 1.0, static_cast<double>(y.cols()) - 1);
    const Eigen::VectorXd there = y * m.has.matrix() / some;
    m.mean = y * (1 - m.has).matrix() / (static_cast<double>(y.cols()) - some);
    m.offset = there - m.mean;
    m.share = some / static_cast<double>(y.cols());
    m.variance = (((y.colwise() - m.mean).colwise().squaredNorm().array().transpose() * (1 - m.has)).sum() +
                  ((y.colwise() - there).colwise().squaredNorm().array().transpose() * m.has).sum()) /
                 count;
  }
  return m;
}

// Whether neither the pose nor the place in the session says which touches have it.
bool IsAtRandom(const touches::Observations& o, const Cloud& cloud, const Eigen::ArrayXd& has) {
  const double mean = has.mean();
  const Eigen::ArrayXd apart = has - mean;
  const double variance = apart.square().mean();
  if (!(variance > 0)) return false;
  const long n = has.size();
  if ((apart.head(n - 1) * apart.tail(n - 1)).mean() > kSessionRules.max_autocorrelation * variance)
    return false;
  std::vector<double> sum(o.poses, 0), squares(o.poses, 0);
  std::vector<int> count(o.poses, 0);
  for (long t = 0; t < n; ++t) {
    const int pose = o.pose[cloud.touch[static_cast<size_t>(t)]];
    sum[pose] += apart[t], squares[pose] += apart[t] * apart[t], ++count[pose];
  }
  double within = 0, dof = 0;
  for (int pose = 0; pose < o.poses; ++pose) {
    if (count[pose] < 2) continue;
    within += squares[pose] - sum[pose] * sum[pose] / count[pose];
    dof += count[pose] - 1;
  }
  return dof < kSessionRules.min_offset_touches / 2 ||
         within / dof > kSessionRules.min_within_poses * variance;
}

}  // namespace

std::optional<PartialOffset> FindPartialOffset(const touches::Observations& o,
                                               const std::vector<double>& residuals) {
  if (o.fingers < 2) return std::nullopt;
  const Cloud cloud = CloudOf(o, residuals);
  if (static_cast<int>(cloud.touch.size()) < kSessionRules.min_offset_touches) return std::nullopt;
  const double sigma = std::sqrt((cloud.y.colwise() - cloud.y.rowwise().mean().eval()).squaredNorm() /
                                 static_cast<double>(cloud.y.size()));
  Mixture best;
  for (int finger = 0; finger < o.fingers; ++finger)
    for (const double sign : {-1.0, 1.0}) {
      Mixture m = FitMixture(cloud.y, sign * 2 * sigma * cloud.basis.col(finger).normalized());
      if (m.log_likelihood > best.log_likelihood) best = std::move(m);
    }
  const double count = static_cast<double>(cloud.y.size());
  const double more = 0.5 * static_cast<double>(o.fingers) * std::log(count);  // values beyond one Gaussian's
  PartialOffset found;
  const auto [white, log_volume] = Whitened(cloud.y);
  const double single = log_volume + std::max(GaussianLogLikelihood(white), StudentLogLikelihood(white));
  found.gain_nats = best.log_likelihood - more - single;
  if (found.gain_nats < kSessionRules.offset ||
      best.offset.norm() < kSessionRules.min_separation * std::sqrt(best.variance))
    return std::nullopt;
  if (best.share > 0.5) best.share = 1 - best.share, best.offset = -best.offset;
  if (best.share < kSessionRules.min_offset_share || !IsAtRandom(o, cloud, best.has)) return std::nullopt;
  found.share = best.share;
  const Eigen::VectorXd offset = cloud.basis.transpose() * best.offset;
  found.offset_s.assign(offset.data(), offset.data() + offset.size());
  // One finger against the others moves these by as much each.
  int finger = 0;
  for (int i = 1; i < o.fingers; ++i)
    if (std::abs(offset[i]) > std::abs(offset[finger])) finger = i;
  const double later_s = offset[finger] * o.fingers / (o.fingers - 1.0);
  found.words = absl::StrFormat(
      "In %.0f %% of the touches finger %s reports %s %s than in the others, beside the other fingers; "
      "neither the pose nor the time says in which.",
      100 * found.share, model::FingerName(finger, o.fingers), TimeInWords(std::abs(later_s)),
      later_s > 0 ? "later" : "earlier");
  return found;
}

}  // namespace touchstone::diagnosis::selection
