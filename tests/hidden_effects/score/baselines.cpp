#include "tests/hidden_effects/score/baselines.h"

#include <Eigen/Dense>

#include <cmath>
#include <random>

#include "server/base/numbers/decompositions.h"
#include "server/base/status.h"
#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"
#include "server/effects/all_effects.h"

namespace touchstone::hidden {
namespace {

struct Columns {
  std::string effect;
  Eigen::MatrixXd gradient;  // one row per finger's time, in s
  int rank = 0;
};

// The residuals that exist, with every touch's mean taken out.
std::vector<int> RowsOf(const std::vector<double>& residuals) {
  std::vector<int> rows;
  for (size_t k = 0; k < residuals.size(); ++k)
    if (std::isfinite(residuals[k])) rows.push_back(k);
  return rows;
}

// The step of the finite difference of each value, SI.
std::vector<std::vector<double>> Steps(const model::Effect& effect, int fingers) {
  std::vector<std::vector<double>> steps;
  const std::vector<double> neutral = effect.NeutralValues(fingers);
  size_t at = 0;
  for (const model::ParameterInfo& info : effect.parameters) {
    for (int k = 0; k < info.Count(fingers); ++k, ++at) {
      std::vector<double> values = neutral;
      if (effect.name == "acceleration_ramp")
        values[at] = 0.004;  // visible only when slow
      else
        values[at] += ToSi(info.unit, 0.1 * (info.typical - info.neutral));
      // A sum of 0 stays one.
      if (info.sum_zero)
        for (int i = 0; i < fingers; ++i)
          values[at - k + i] -= (values[at] - neutral[at]) / fingers * (i != k);
      if (info.sum_zero) values[at] *= (fingers - 1.0) / fingers;
      steps.push_back(values);
    }
  }
  return steps;
}

double LeastSquares(const Eigen::MatrixXd& x, const Eigen::VectorXd& y, int* rank) {
  if (x.cols() == 0) return *rank = 0, y.squaredNorm();
  const Eigen::VectorXd scale = x.colwise().norm().cwiseMax(1e-30);
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(x * scale.cwiseInverse().asDiagonal());
  qr.setThreshold(1e-5);
  *rank = qr.rank();
  const Eigen::VectorXd projected = (qr.householderQ().adjoint() * y).eval();
  return projected.tail(y.size() - qr.rank()).squaredNorm();
}

Eigen::MatrixXd Beside(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  Eigen::MatrixXd out(b.rows(), a.cols() + b.cols());
  if (a.cols() > 0) out.leftCols(a.cols()) = a;
  out.rightCols(b.cols()) = b;
  return out;
}

// Adds the best effect as long as `accept(before, after, ranks)` is true.
template <typename Accept>
std::vector<std::string> Forward(const std::vector<Columns>& candidates, const Eigen::VectorXd& y,
                                 Accept accept) {
  std::vector<std::string> chosen;
  std::vector<char> taken(candidates.size(), 0);
  Eigen::MatrixXd x(y.size(), 0);
  int rank = 0;
  double rss = y.squaredNorm();
  while (chosen.size() < 5) {
    int best = -1, best_rank = 0;
    double best_gain = 0, best_rss = 0;
    for (size_t k = 0; k < candidates.size(); ++k) {
      if (taken[k]) continue;
      int with_rank = 0;
      const double with = LeastSquares(Beside(x, candidates[k].gradient), y, &with_rank);
      const double gain = accept(rss, with, with_rank - rank);
      if (gain > best_gain) best = k, best_gain = gain, best_rank = with_rank, best_rss = with;
    }
    if (best < 0) break;
    taken[best] = 1;
    chosen.push_back(candidates[best].effect);
    x = Beside(x, candidates[best].gradient);
    rank = best_rank, rss = best_rss;
  }
  return chosen;
}

// Log evidence that a Gaussian process over the surface of each object (squared exponential, 25 mm, as random
// waves) gains over none, at its best amplitude.
double GaussianProcessNats(const diagnosis::touches::Observations& observations,
                           const diagnosis::touches::Prediction& prediction, const std::vector<int>& rows,
                           const Eigen::VectorXd& y, double sigma_s) {
  constexpr int kWaves = 40;
  constexpr double kLengthM = 0.025;
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd waves(kWaves, 3);
  for (int k = 0; k < waves.size(); ++k) waves.data()[k] = normal(random) / kLengthM;
  const int fingers = observations.fingers;
  std::vector<Eigen::VectorXd> eigenvalues, loads;
  for (size_t object = 0; object < observations.objects.size(); ++object) {
    std::vector<int> mine;
    for (size_t r = 0; r < rows.size(); ++r)
      if (observations.object[rows[r] / fingers] == static_cast<int>(object)) mine.push_back(r);
    Eigen::MatrixXd features(mine.size(), 2 * kWaves);
    Eigen::VectorXd part(mine.size());
    for (size_t m = 0; m < mine.size(); ++m) {
      const Eigen::VectorXd phase = waves * prediction.contact_m[rows[mine[m]]];
      features.row(m).head(kWaves) = phase.array().cos();
      features.row(m).tail(kWaves) = phase.array().sin();
      part[m] = y[mine[m]];
    }
    // Only differences between the fingers of a touch are seen.
    for (size_t begin = 0; begin < mine.size();) {
      size_t end = begin + 1;
      while (end < mine.size() && rows[mine[end]] / fingers == rows[mine[begin]] / fingers) ++end;
      const Eigen::RowVectorXd mean = features.middleRows(begin, end - begin).colwise().mean();
      features.middleRows(begin, end - begin).rowwise() -= mean;
      begin = end;
    }
    features /= std::sqrt(kWaves) * sigma_s;
    part /= sigma_s;
    const SymmetricEigen solver = EigenOfSymmetric(features.transpose() * features);
    eigenvalues.push_back(solver.values.cwiseMax(0));
    loads.push_back(solver.vectors.transpose() * (features.transpose() * part));
  }
  double best = 0;
  for (double amplitude_s = 0.05 * sigma_s; amplitude_s < 20 * sigma_s; amplitude_s *= 1.4) {
    double nats = 0;
    for (size_t object = 0; object < eigenvalues.size(); ++object) {
      const Eigen::ArrayXd grown = 1 + amplitude_s * amplitude_s * eigenvalues[object].array();
      nats += 0.5 * (amplitude_s * amplitude_s * loads[object].array().square() / grown).sum() -
              0.5 * grown.log().sum();
    }
    best = std::max(best, nats);
  }
  return best;
}

}  // namespace

absl::StatusOr<Baselines> RunBaselines(const diagnosis::DiagnosisInput& input) {
  Baselines out;
  if (!input.set->has_poses) return out;
  TOUCHSTONE_ASSIGN_OR_RETURN(const diagnosis::touches::Observations observations,
                              diagnosis::touches::MakeObservations(input));
  TOUCHSTONE_ASSIGN_OR_RETURN(const diagnosis::touches::Prediction nominal,
                              diagnosis::touches::Predict(observations, *input.model, true, false, nullptr));
  const std::vector<double> residuals = diagnosis::touches::Residuals(observations, nominal);
  std::vector<int> rows = RowsOf(residuals);

  std::vector<Columns> candidates;
  for (const auto& effect : effects::TouchEffects()) {
    Columns columns{effect->name, Eigen::MatrixXd(residuals.size(), 0), 0};
    if (effect->parameters.empty() || effect->name == "surface_error") continue;
    bool in_model = false;
    for (const model::EffectInstance& instance : input.model->effects)
      in_model |= instance.effect->name == effect->name;
    if (in_model) continue;
    for (const std::vector<double>& values : Steps(*effect, observations.fingers)) {
      model::Model model = *input.model;
      model.effects.push_back({effect, false, values, {}});
      TOUCHSTONE_ASSIGN_OR_RETURN(const diagnosis::touches::Prediction moved,
                                  diagnosis::touches::Predict(observations, model, false, false, nullptr));
      const std::vector<double> then = diagnosis::touches::Residuals(observations, moved);
      Eigen::VectorXd column(residuals.size());
      // Where a contact jumps to another face, the difference is none.
      for (size_t k = 0; k < residuals.size(); ++k) {
        const double difference = residuals[k] - then[k];
        column[k] = std::isfinite(difference) && std::abs(difference) < 0.2 ? difference : 0;
      }
      if (column.squaredNorm() > 1e-20) columns.gradient = Beside(columns.gradient, column);
    }
    if (columns.gradient.cols() > 0) candidates.push_back(std::move(columns));
  }

  Eigen::VectorXd y(rows.size());
  for (size_t r = 0; r < rows.size(); ++r) y[r] = residuals[rows[r]];
  for (Columns& columns : candidates) {
    Eigen::MatrixXd kept(rows.size(), columns.gradient.cols());
    for (size_t r = 0; r < rows.size(); ++r) kept.row(r) = columns.gradient.row(rows[r]);
    columns.gradient = std::move(kept);
  }
  const double n = rows.size() * (observations.fingers - 1.0) / observations.fingers;
  out.bic = Forward(candidates, y, [n](double before, double after, int ranks) {
    return n * std::log(before / after) - ranks * std::log(n);
  });
  out.rmse_drop = Forward(
      candidates, y, [](double before, double after, int) { return 1 - std::sqrt(after / before) - 0.02; });
  const double sigma_s = std::sqrt(y.squaredNorm() / n);
  out.gp_detects = GaussianProcessNats(observations, nominal, rows, y, sigma_s) > 3;
  return out;
}

}  // namespace touchstone::hidden
