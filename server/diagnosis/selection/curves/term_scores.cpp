#include "server/diagnosis/selection/curves/term_scores.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/base/numbers/decompositions.h"

namespace touchstone::diagnosis::selection {

TermScorer::TermScorer(const engine::Experiment& experiment, const engine::Fit& fit)
    : likelihood_(*experiment.likelihood), fit_(fit) {
  std::vector<int> members(1 + fit.model.size());
  std::iota(members.begin(), members.end(), 0);
  base_log_ = engine::ComputeLaplaceEvidence(likelihood_, engine::Grams(likelihood_, fit.columns), members,
                                             fit.model.parameters(), fit.point)
                  .log_likelihood;
}

TermScores TermScorer::Score(const Eigen::MatrixXd& columns, int width,
                             const std::vector<double>& scales) const {
  const engine::Likelihood::Columns prepared = likelihood_.Prepare(columns);
  const int blocks = static_cast<int>(columns.cols()) / width;
  TermScores scores;
  scores.step.setZero(width, blocks);
  std::vector<double> best(blocks, -INFINITY), sum_evidence(blocks, 0), sum_likelihood(blocks, 0);
  for (int s = 0; s < static_cast<int>(likelihood_.hypotheses().size()); ++s) {
    const Projection projection = Project(prepared, width, s);
    for (int b = 0; b < blocks; ++b) {
      const BlockFit block = FitBlock(projection, b, width, scales, s);
      if (!block.determined) continue;
      sum_likelihood[b] += std::exp(std::min(block.log_likelihood - base_log_, 600.0));
      sum_evidence[b] += std::exp(std::min(block.log_evidence - base_log_, 600.0));
      if (block.log_evidence > best[b]) best[b] = block.log_evidence, scores.step.col(b) = block.step;
    }
  }
  scores.log_evidence.resize(blocks);
  scores.log_ratio.resize(blocks);
  for (int b = 0; b < blocks; ++b) {
    scores.log_ratio[b] = sum_likelihood[b] > 0 ? std::log(sum_likelihood[b]) : -INFINITY;
    scores.log_evidence[b] = sum_evidence[b] > 0 ? std::log(sum_evidence[b]) : -INFINITY;
    // Where the sums overflow the best hypothesis alone counts.
    if (best[b] - base_log_ > 500) scores.log_evidence[b] = scores.log_ratio[b] = best[b] - base_log_;
  }
  return scores;
}

TermScorer::Projection TermScorer::Project(const engine::Likelihood::Columns& prepared, int width,
                                           int s) const {
  const int p = fit_.model.size();
  const Eigen::MatrixXd own = likelihood_.Gram(fit_.columns, s);
  Projection projection;
  projection.cross = likelihood_.Cross(fit_.columns, prepared, s);
  projection.norms = likelihood_.Norms(prepared, s);
  projection.q = own(0, 0);
  if (p > 0) {
    Eigen::MatrixXd jj = own.bottomRightCorner(p, p);
    for (int i = 0; i < p; ++i) jj(i, i) *= 1 + 1e-9, jj(i, i) += 1e-300;
    const SymmetricSolver solver(jj);
    projection.own_step = solver.Solve(own.col(0).tail(p));
    projection.own_cross = solver.SolveColumns(projection.cross.bottomRows(p));
    projection.q -= own.col(0).tail(p).dot(projection.own_step);
  }
  if (width == 2) {
    projection.inner.resize(projection.norms.size() / 2);
    for (int b = 0; b < projection.inner.size(); ++b)
      projection.inner[b] = likelihood_.Cross(engine::Likelihood::Pick(prepared, {2 * b}),
                                              engine::Likelihood::Pick(prepared, {2 * b + 1}), s)(0, 0);
  }
  return projection;
}

TermScorer::BlockFit TermScorer::FitBlock(const Projection& projection, int b, int width,
                                          const std::vector<double>& scales, int s) const {
  const int p = fit_.model.size();
  Eigen::MatrixXd a(width, width);
  Eigen::VectorXd g(width);
  for (int i = 0; i < width; ++i) {
    const int ci = b * width + i;
    const auto own = [&](int column) { return projection.cross.col(column).tail(p); };
    g[i] = projection.cross(0, ci) - (p > 0 ? own(ci).dot(projection.own_step) : 0);
    for (int j = 0; j < width; ++j) {
      a(i, j) = i == j ? projection.norms[ci] : projection.inner[b];
      if (p > 0) a(i, j) -= own(ci).dot(projection.own_cross.col(b * width + j));
    }
    if (!(a(i, i) > 1e-6 * projection.norms[ci])) a(i, i) = INFINITY;  // the fit has it already
  }
  BlockFit block;
  block.determined = a.allFinite();
  if (!block.determined) return block;
  for (int i = 0; i < width; ++i) a(i, i) *= 1 + 1e-9;
  block.step = SymmetricSolver(a).Solve(g);
  const double left = std::max(projection.q - g.dot(block.step), 0.0);
  const double sigma = likelihood_.Sigma(left, p + width);
  double occam = 0;
  for (int i = 0; i < width; ++i) {
    const double scale = scales[b * width + i];
    occam += 0.5 * std::log1p(a(i, i) * scale * scale / (sigma * sigma)) +
             std::log1p(std::pow(block.step[i] / scale, 2));
  }
  block.log_likelihood = likelihood_.LogPrior(s) + likelihood_.LogLikelihood(left, s);
  block.log_evidence = block.log_likelihood - occam;
  return block;
}

}  // namespace touchstone::diagnosis::selection
