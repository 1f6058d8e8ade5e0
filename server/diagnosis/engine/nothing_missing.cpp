#include "server/diagnosis/engine/nothing_missing.h"

#include <algorithm>
#include <cmath>

#include "server/base/numbers/decompositions.h"
#include "server/base/numbers/distributions.h"
#include "server/base/numbers/random.h"
#include "server/diagnosis/engine/rules.h"

namespace touchstone::diagnosis::engine {
namespace {

// Kinds draw from one seed: a draw of one goes with a draw of another index of the next.
constexpr int kDrawsApart = 37;

// A value per group.
Eigen::MatrixXd OnEachGroup(const ObservationModel& rows, const Eigen::MatrixXd& columns) {
  const int groups = static_cast<int>(rows.groups().size());
  Eigen::MatrixXd apart = Eigen::MatrixXd::Zero(columns.rows(), groups * columns.cols());
  for (int group = 0; group < groups; ++group) {
    const int first = rows.FirstRowOfGroup(group), count = rows.FirstRowOfGroup(group + 1) - first;
    apart.block(first, group * columns.cols(), count, columns.cols()) = columns.middleRows(first, count);
  }
  return apart;
}

}  // namespace

void LinearHypotheses::Add(const Eigen::MatrixXd& columns, int first_row) {
  if (columns.cols() == 0 || !columns.allFinite()) return;
  // Columns of any unit: only their directions count.
  Eigen::MatrixXd scaled = columns;
  for (int j = 0; j < scaled.cols(); ++j)
    if (const double norm = scaled.col(j).norm(); norm > 0) scaled.col(j) /= norm;
  const ColumnSpan span(scaled);
  if (span.rank() == 0 || 2 * span.rank() > columns.rows()) return;
  bases_.push_back({span.Basis(), first_row});
}

void LinearHypotheses::AddRows(int first_row, int rows) {
  bases_.push_back({Eigen::MatrixXd::Identity(rows, rows), first_row});
}

void LinearHypotheses::AddEffects(const ObservationModel& rows, const std::vector<EffectColumns>& effects) {
  for (const EffectColumns& effect : effects) {
    if (effect.shared < 0) {
      Add(effect.columns);
      continue;
    }
    const Eigen::MatrixXd& columns = effects[effect.shared].columns;
    if (effect.extension.object.empty()) {
      Add(OnEachGroup(rows, columns));
      continue;
    }
    const std::vector<std::string>& groups = rows.groups();
    const int group =
        static_cast<int>(std::find(groups.begin(), groups.end(), effect.extension.object) - groups.begin());
    const int first = rows.FirstRowOfGroup(group);
    Add(columns.middleRows(first, rows.FirstRowOfGroup(group + 1) - first), first);
  }
}

LinearHypotheses::Parts LinearHypotheses::PartsOf(const Basis& basis) const {
  Parts parts;
  for (size_t c = 0; c + 1 < clusters_.size(); ++c) {
    const int first = std::max(clusters_[c] - basis.first_row, 0);
    const int rows = std::min<int>(clusters_[c + 1] - basis.first_row, basis.columns.rows()) - first;
    if (rows > 0 && !basis.columns.middleRows(first, rows).isZero()) parts.emplace_back(first, rows);
  }
  return parts;
}

double LinearHypotheses::Overdispersion(const Basis& basis, const Parts& parts,
                                        const Eigen::VectorXd& residual, double variance) {
  const auto own = residual.segment(basis.first_row, basis.columns.rows());
  const Eigen::VectorXd left = own - basis.columns * (basis.columns.transpose() * own);
  double squares = 0;
  for (const auto& [first, rows] : parts)
    squares += (basis.columns.middleRows(first, rows).transpose() * left.segment(first, rows)).squaredNorm();
  // What the columns have followed is given back.
  const double clusters = static_cast<double>(parts.size()), rank = static_cast<double>(basis.columns.cols());
  return std::max(squares / (variance * rank) * clusters / (clusters - rank), 1.0);
}

Eigen::MatrixXd LinearHypotheses::PValues(const Eigen::MatrixXd& residuals) const {
  Eigen::MatrixXd p_values = Eigen::MatrixXd::Ones(size(), residuals.cols());
  const Eigen::RowVectorXd all = residuals.colwise().squaredNorm();
  for (int h = 0; h < size(); ++h) {
    const Basis& basis = bases_[h];
    const Eigen::RowVectorXd taken =
        (basis.columns.transpose() * residuals.middleRows(basis.first_row, basis.columns.rows()))
            .colwise()
            .squaredNorm();
    const double rank = static_cast<double>(basis.columns.cols());
    const double left = static_cast<double>(residuals.rows()) - eliminated_ - rank;
    const Parts parts = PartsOf(basis);
    const bool clustered = !clusters_.empty();
    const double degrees = clustered ? static_cast<double>(parts.size()) - rank : left;
    if (clustered && degrees < kEngineRules.min_degrees_of_freedom) continue;
    for (int draw = 0; draw < residuals.cols(); ++draw) {
      const double variance = std::max((all[draw] - taken[draw]) / left, 1e-300);
      const double over = clustered ? Overdispersion(basis, parts, residuals.col(draw), variance) : 1;
      p_values(h, draw) = FisherTail(taken[draw] / rank / (variance * over), rank, degrees);
    }
  }
  return p_values;
}

Eigen::MatrixXd DataAndNoise(const ObservationModel& rows, const Eigen::VectorXd& residual, uint64_t seed,
                             int draws) {
  Eigen::MatrixXd columns(residual.size(), 1 + draws);
  columns.col(0) = residual;
  for (int draw = 1; draw <= draws; ++draw) {
    RandomStream random(seed, RandomDomain::kDiagnosis, draw);
    for (int row = 0; row < residual.size(); ++row) columns(row, draw) = random.Normal();
  }
  columns.rightCols(draws) = rows.WithoutEliminated(columns.rightCols(draws));
  return columns;
}

Eigen::MatrixXd DataAndTurned(const Eigen::VectorXd& residual, const std::vector<int>& clusters,
                              uint64_t seed, int draws) {
  Eigen::MatrixXd columns(residual.size(), 1 + draws);
  columns.col(0) = residual;
  for (int draw = 1; draw <= draws; ++draw) {
    RandomStream random(seed, RandomDomain::kDiagnosis, draw);
    for (size_t c = 0; c + 1 < clusters.size(); ++c) {
      const int rows = clusters[c + 1] - clusters[c];
      columns.col(draw).segment(clusters[c], rows) =
          (random.Uniform() < 0.5 ? -1.0 : 1.0) * residual.segment(clusters[c], rows);
    }
  }
  return columns;
}

Eigen::MatrixXd PValuesOfStatistics(const Eigen::MatrixXd& statistics) {
  Eigen::MatrixXd p_values = Eigen::MatrixXd::Ones(statistics.rows(), statistics.cols());
  const auto draws = statistics.rightCols(statistics.cols() - 1);
  for (int h = 0; h < statistics.rows(); ++h) {
    const double mean = draws.row(h).mean();
    const double deviation = std::sqrt((draws.row(h).array() - mean).square().mean());
    if (!(deviation > 0)) continue;
    for (int draw = 0; draw < statistics.cols(); ++draw)
      p_values(h, draw) = std::erfc(std::abs(statistics(h, draw) - mean) / deviation / std::sqrt(2.0));
  }
  return p_values;
}

TriedPValues AgreeingPValues(int hypotheses) {
  return TriedPValues::Ones(hypotheses, 1 + kEngineRules.noise_draws);
}

TriedPValues ImpossiblePValues(int hypotheses) {
  TriedPValues p_values = AgreeingPValues(hypotheses);
  p_values.col(0).setZero();
  return p_values;
}

NothingMissing WorstOfAll(const TriedPValues& p_values) {
  NothingMissing worst;
  worst.hypotheses = static_cast<int>(p_values.rows());
  if (worst.hypotheses == 0 || p_values.cols() < 2) return worst;
  const Eigen::RowVectorXd least = p_values.colwise().minCoeff();
  const auto as_bad = (least.rightCols(least.size() - 1).array() <= least[0]).count();
  worst.p = (1.0 + static_cast<double>(as_bad)) / static_cast<double>(least.size());
  // Beyond all draws: what each hypothesis by itself allows, paid for all of them.
  if (as_bad == 0) worst.p = std::min(worst.p, worst.hypotheses * least[0]);
  return worst;
}

NothingMissing WithFurther(NothingMissing worst, double p) {
  // Bonferroni's inequality, by weights: as much for the one as for each of the others.
  const double others = worst.hypotheses, all = others + 1;
  worst.hypotheses += 1;
  worst.p = std::min({others > 0 ? worst.p * all / others : 1, p * all, 1.0});
  return worst;
}

NothingMissing WithRest(const NothingMissing& worst, const UnexplainedRest& rest, double p) {
  for (const CovariateTest& test : rest.covariates) p = std::min(p, test.p);
  return p < 1 ? WithFurther(worst, p) : worst;
}

std::optional<NothingMissing> WorstOfKinds(const std::vector<const TriedPValues*>& kinds) {
  if (kinds.empty()) return std::nullopt;
  Eigen::Index hypotheses = 0, draws = kinds[0]->cols() - 1;
  for (const TriedPValues* kind : kinds) {
    if (kind->rows() == 0 || kind->cols() < 2) return std::nullopt;
    hypotheses += kind->rows();
    draws = std::min(draws, kind->cols() - 1);
  }
  TriedPValues all(hypotheses, 1 + draws);
  Eigen::Index first = 0;
  for (size_t k = 0; k < kinds.size(); ++k) {
    const TriedPValues& own = *kinds[k];
    auto part = all.middleRows(first, own.rows());
    part.col(0) = own.col(0);
    for (Eigen::Index draw = 0; draw < draws; ++draw)
      part.col(1 + draw) =
          own.col(1 + (draw + static_cast<Eigen::Index>(k) * kDrawsApart) % (own.cols() - 1));
    first += own.rows();
  }
  return WorstOfAll(all);
}

}  // namespace touchstone::diagnosis::engine
