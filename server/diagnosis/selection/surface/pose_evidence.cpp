#include "server/diagnosis/selection/surface/pose_evidence.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/numbers/decompositions.h"
#include "server/diagnosis/selection/surface/rules.h"
#include "server/effects/contact/surface_departure.h"

namespace touchstone::diagnosis::selection {
namespace {

std::vector<PoseMean> MeansOf(const Workspace& workspace, const Eigen::MatrixXd& rows) {
  const touches::Contrasts& contrasts = *workspace.contrasts;
  const touches::Observations& o = *workspace.searched;
  std::map<std::pair<int, uint32_t>, PoseMean> by_pose;
  for (int t = 0; t < static_cast<int>(contrasts.touches().size()); ++t) {
    const int k = contrasts.touches()[t];
    uint32_t fingers = 0;
    for (int i = 0; i < o.fingers; ++i) fingers |= contrasts.TakesPart(t, i) ? 1u << i : 0;
    PoseMean& mean = by_pose[{o.pose[k], fingers}];
    const int count = static_cast<int>(contrasts.MatrixOf(t).rows());
    if (mean.repeats == 0) mean.touch = t, mean.object = o.object[k], mean.pose = o.pose[k];
    if (mean.repeats == 0) mean.mean = Eigen::MatrixXd::Zero(count, rows.cols());
    const double root = contrasts.root_weights()[t];
    const Eigen::MatrixXd scaled = rows.middleRows(contrasts.FirstRow(t), count);
    mean.mean += root * scaled;
    mean.weight += root * root;
    mean.scatter_s2 += scaled.col(0).squaredNorm();
    ++mean.repeats;
  }
  std::vector<PoseMean> means;
  for (auto& [key, mean] : by_pose) {
    if (!(mean.weight > 0)) continue;
    mean.mean /= mean.weight;
    mean.scatter_s2 = std::max(mean.scatter_s2 - mean.weight * mean.mean.col(0).squaredNorm(), 0.0);
    means.push_back(std::move(mean));
  }
  std::stable_sort(means.begin(), means.end(),
                   [](const PoseMean& a, const PoseMean& b) { return a.object < b.object; });
  return means;
}

}  // namespace

PoseEvidence::PoseEvidence(const Workspace& workspace, const engine::Fit& fit,
                           const touches::Prediction& details)
    : workspace_(workspace), details_(details), means_(MeansOf(workspace, fit.columns.values)) {
  Eigen::Index rows = 0;
  for (const PoseMean& mean : means_) rows += mean.mean.rows();
  values_.resize(rows, fit.columns.values.cols());
  Eigen::Index row = 0;
  for (const PoseMean& mean : means_) {
    values_.middleRows(row, mean.mean.rows()) = mean.mean;
    row += mean.mean.rows();
  }
}

std::vector<int> PoseEvidence::FirstRows(bool by_object) const {
  if (!by_object) return {0, static_cast<int>(values_.rows())};
  std::vector<int> first(workspace_.searched->objects.size() + 1, 0);
  for (const PoseMean& mean : means_) first[mean.object + 1] += static_cast<int>(mean.mean.rows());
  for (size_t object = 1; object < first.size(); ++object) first[object] += first[object - 1];
  return first;
}

engine::SmoothErrorGeometry PoseEvidence::GeometryOf(const PoseFunction& function) const {
  const touches::Observations& o = *workspace_.searched;
  const size_t groups = function.by_object ? o.objects.size() : 1;
  engine::SmoothErrorGeometry geometry;
  geometry.sites.resize(groups);
  geometry.distinct_m.resize(groups);
  geometry.size_m = function.size;
  int row = 0, counted = 0;
  for (const PoseMean& mean : means_) {
    const int k = workspace_.contrasts->touches()[mean.touch];
    const Eigen::MatrixXd& h = workspace_.contrasts->MatrixOf(mean.touch);
    const size_t group = function.by_object ? mean.object : 0;
    for (int i = 0; i < o.fingers; ++i) {
      if (!workspace_.contrasts->TakesPart(mean.touch, i)) continue;
      const size_t e = static_cast<size_t>(k) * o.fingers + i;
      engine::SmoothErrorSite site;
      site.position_m = function.place(e, i, mean.object);
      // A finger that the fit's model expects to miss says nothing of a place.
      if (!site.position_m.allFinite() || !std::isfinite(details_.inverse_speed_s_per_m[e])) continue;
      site.first_row = row;
      const double cosine =
          function.along_normal ? std::max(details_.cos_incidence[e], effects::kMinDepartureCosine) : 1.0;
      for (int j = 0; j < h.rows(); ++j)
        site.row_per_m.push_back(-details_.inverse_speed_s_per_m[e] / cosine * h(j, i));
      geometry.mean_row_per_m += details_.inverse_speed_s_per_m[e];
      ++counted;
      if (function.knots.empty()) geometry.distinct_m[group].push_back(site.position_m);
      geometry.sites[group].push_back(std::move(site));
    }
    row += static_cast<int>(mean.mean.rows());
  }
  if (!function.knots.empty()) geometry.distinct_m[0] = function.knots;
  if (counted > 0) geometry.mean_row_per_m /= counted;
  return geometry;
}

engine::Likelihood PoseEvidence::LikelihoodOf(const PoseFunction& function) const {
  const engine::SmoothErrorGeometry geometry = GeometryOf(function);
  return engine::Likelihood(FirstRows(function.by_object), &geometry, 0, workspace_.context.pool);
}

double PoseEvidence::NatsOfOwnErrors(OwnError kind) const {
  // Every pose in the axes in which its contrasts' own errors are independent.
  std::vector<double> energies, squares_s2;
  double mean_row_per_m = 0;
  for (const PoseMean& mean : means_) {
    const int k = workspace_.contrasts->touches()[mean.touch], fingers = workspace_.searched->fingers;
    const Eigen::MatrixXd& h = workspace_.contrasts->MatrixOf(mean.touch);
    Eigen::MatrixXd inner = Eigen::MatrixXd::Zero(h.rows(), h.rows());
    for (int i = 0; i < fingers; ++i) {
      const size_t e = static_cast<size_t>(k) * fingers + i;
      if (!workspace_.contrasts->TakesPart(mean.touch, i) ||
          !std::isfinite(details_.inverse_speed_s_per_m[e]))
        continue;
      const double cosine = std::max(details_.cos_incidence[e], effects::kMinDepartureCosine);
      const double growth =
          kind == OwnError::kAlongNormal ? 1 / cosine : std::sqrt(std::max(1 / (cosine * cosine) - 1, 0.0));
      const double row_per_m = details_.inverse_speed_s_per_m[e] * growth;
      inner += row_per_m * row_per_m * h.col(i) * h.col(i).transpose();
      mean_row_per_m += details_.inverse_speed_s_per_m[e] / (fingers * static_cast<double>(means_.size()));
    }
    const SymmetricEigen eigen = EigenOfSymmetric(inner);
    const Eigen::VectorXd turned = eigen.vectors.transpose() * mean.mean.col(0);
    for (Eigen::Index j = 0; j < turned.size(); ++j) {
      energies.push_back(std::max(eigen.values[j], 0.0));
      squares_s2.push_back(turned[j] * turned[j]);
    }
  }
  const double n = static_cast<double>(energies.size());
  if (n == 0 || !(mean_row_per_m > 0)) return 0;
  const auto log_likelihood = [&](double ratio) {
    double q = 0, log_determinant = 0;
    for (size_t j = 0; j < energies.size(); ++j) {
      const double variance = 1 + ratio * ratio * energies[j] / (mean_row_per_m * mean_row_per_m);
      q += squares_s2[j] / variance, log_determinant += std::log(variance);
    }
    return -0.5 * n * std::log(std::max(q, 1e-300) / n) - 0.5 * log_determinant;
  };
  std::vector<double> logs;
  for (double ratio = kSurfaceRules.min_own_ratio; ratio < kSurfaceRules.max_own_ratio;
       ratio *= kSurfaceRules.own_ratio_step)
    logs.push_back(log_likelihood(ratio) - log_likelihood(0));
  const double best = *std::max_element(logs.begin(), logs.end());
  double sum = 0;
  for (const double log : logs) sum += std::exp(log - best) / static_cast<double>(logs.size());
  return best + std::log(sum);
}

double PoseEvidence::NatsOf(const engine::Likelihood& likelihood, int* best, double* sigma_s) const {
  const engine::Likelihood::Columns columns = likelihood.Prepare(values_.col(0));
  const int hypotheses = static_cast<int>(likelihood.hypotheses().size());
  std::vector<double> logs;
  *best = 0;
  for (int s = 0; s < hypotheses; ++s) {
    const double q = likelihood.Gram(columns, s)(0, 0);
    logs.push_back(likelihood.LogLikelihood(q, s));
    if (s > 0 && (*best == 0 || logs[s] > logs[*best])) *best = s, *sigma_s = likelihood.Sigma(q, 0);
  }
  if (hypotheses < 2) return 0;
  double sum = 0;
  for (int s = 1; s < hypotheses; ++s) sum += std::exp(logs[s] - logs[*best]) / (hypotheses - 1);
  return logs[*best] + std::log(sum) - logs[0];
}

}  // namespace touchstone::diagnosis::selection
