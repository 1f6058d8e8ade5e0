#include "server/diagnosis/fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/status.h"

namespace touchstone {
namespace {

constexpr double kStep = 0.02;     // of a coordinate's scale, for derivatives
constexpr double kJumpM = 0.3e-3;  // a finger that moves so far within a step has met another face
constexpr double kJumpOverMedian = 200;
constexpr int kMostHalvings = 5;
constexpr double kConverged = 0.02;  // nats
constexpr double kSmallStep = 0.05;  // standard errors
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

double LogPriorOfValues(const std::vector<Coordinate>& coordinates, const Eigen::VectorXd& point) {
  double sum = 0;
  for (size_t i = 0; i < coordinates.size(); ++i) {
    const double x =
        (point[static_cast<int>(i)] - coordinates[i].neutral) / (kPriorWidth * coordinates[i].scale);
    sum -= std::log1p(x * x);
  }
  return sum;
}

}  // namespace

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

Eigen::VectorXd ResidualContrasts(const Experiment& experiment, const std::vector<double>& predicted_s) {
  const std::vector<double>& measured = experiment.observations->time_s;
  std::vector<double> residual(measured.size());
  for (size_t e = 0; e < measured.size(); ++e)
    residual[e] = measured[e] - (std::isnan(predicted_s[e]) ? experiment.nominal_s[e] : predicted_s[e]);
  return experiment.contrasts->Apply(residual);
}

absl::StatusOr<std::vector<double>> PredictTimes(const Experiment& experiment, const Model& model) {
  TOUCHSTONE_ASSIGN_OR_RETURN(Prediction prediction, experiment.predictor->Run(model, false, false));
  return std::move(prediction.time_s);
}

absl::StatusOr<Eigen::MatrixXd> Derivatives(const Experiment& experiment, const FreeModel& model,
                                            const Eigen::VectorXd& point, const std::vector<double>& at_s,
                                            int first) {
  // One simulation a shape: coordinates that differ by object only are moved together.
  std::map<int, std::vector<int>> shapes;
  for (int i = first; i < model.size(); ++i) shapes[model.coordinates()[i].shape].push_back(i);
  std::vector<std::vector<int>> tasks;
  for (auto& [shape, members] : shapes) tasks.push_back(std::move(members));

  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(experiment.contrasts->rows(), model.size() - first);
  std::vector<absl::Status> statuses(tasks.size());
  const Observations& o = *experiment.observations;
  const auto run = [&](int begin, int end) {
    for (int task = begin; task < end; ++task) {
      if (experiment.cancelled && experiment.cancelled()) continue;
      Eigen::VectorXd moved = point;
      std::vector<double> steps;
      for (const int i : tasks[task]) {
        const Coordinate& c = model.coordinates()[i];
        double step = kStep * c.scale;
        if (point[i] + step > c.upper) step = -step;
        moved[i] += step;
        steps.push_back(step);
      }
      const absl::StatusOr<std::vector<double>> times = PredictTimes(experiment, model.At(moved));
      if (!times.ok()) {
        statuses[task] = times.status();
        continue;
      }
      // Where a contact jumps there is no derivative.
      std::vector<double> change(at_s.size(), 0.0), sizes;
      for (size_t e = 0; e < at_s.size(); ++e) {
        const double difference = (*times)[e] - at_s[e];
        if (std::isnan(difference)) continue;
        change[e] = difference;
        if (difference != 0) sizes.push_back(std::abs(difference));
      }
      if (sizes.empty()) continue;
      std::nth_element(sizes.begin(), sizes.begin() + sizes.size() / 2, sizes.end());
      const double median = sizes[sizes.size() / 2];
      for (int k = 0; k < o.size(); ++k) {
        const double jump_s = std::max(kJumpM / o.set->speed_m_s[o.row[k]], kJumpOverMedian * median);
        for (int i = 0; i < o.fingers; ++i) {
          double& value = change[static_cast<size_t>(k) * o.fingers + i];
          if (std::abs(value) > jump_s) value = 0;
        }
      }
      const Eigen::VectorXd column = experiment.contrasts->Apply(change);
      for (size_t j = 0; j < tasks[task].size(); ++j) {
        const int i = tasks[task][j];
        const std::string& object = model.coordinates()[i].object;
        if (object.empty()) {
          columns.col(i - first) = column / steps[j];
          continue;
        }
        const int index =
            static_cast<int>(std::find(o.objects.begin(), o.objects.end(), object) - o.objects.begin());
        const int begin_row = experiment.contrasts->FirstRowOfObject(index);
        const int rows = experiment.contrasts->FirstRowOfObject(index + 1) - begin_row;
        columns.col(i - first).segment(begin_row, rows) = column.segment(begin_row, rows) / steps[j];
      }
    }
  };
  if (experiment.pool != nullptr)
    experiment.pool->ParallelFor(static_cast<int>(tasks.size()), 1, run);
  else
    run(0, static_cast<int>(tasks.size()));
  for (const absl::Status& status : statuses) TOUCHSTONE_RETURN_IF_ERROR(status);
  if (experiment.cancelled && experiment.cancelled())
    return absl::CancelledError("the diagnosis was cancelled");
  return columns;
}

absl::StatusOr<Fit> FitModel(const Experiment& experiment, FreeModel start, int most_iterations) {
  const Likelihood& likelihood = *experiment.likelihood;
  Fit fit;
  fit.point = start.Clip(start.Start());
  TOUCHSTONE_ASSIGN_OR_RETURN(fit.time_s, PredictTimes(experiment, start.At(fit.point)));
  std::vector<int> members(start.size() + 1);
  for (int i = 0; i <= start.size(); ++i) members[i] = i;

  Eigen::MatrixXd derivatives;
  Judgement judgement;
  for (int iteration = 0;; ++iteration) {
    TOUCHSTONE_ASSIGN_OR_RETURN(derivatives, Derivatives(experiment, start, fit.point, fit.time_s, 0));
    Eigen::MatrixXd values(likelihood.rows(), start.size() + 1);
    values << ResidualContrasts(experiment, fit.time_s), derivatives;
    fit.columns = likelihood.Prepare(values);
    judgement = Judge(likelihood, Grams(likelihood, fit.columns), members, start.coordinates(), fit.point);
    if (start.size() == 0 || iteration == most_iterations) break;

    // Along the step, as far as the likelihood of the best hypothesis really grows.
    const int s = judgement.surface;
    const double here =
        likelihood.LogLikelihood(likelihood.Gram(Likelihood::Pick(fit.columns, {0}), s)(0, 0), s) +
        LogPriorOfValues(start.coordinates(), fit.point);
    double fraction = 1, gain = 0;
    bool moved = false;
    for (int halving = 0; halving <= kMostHalvings; ++halving, fraction /= 2) {
      const Eigen::VectorXd point = start.Clip(fit.point + fraction * judgement.step);
      TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<double> times, PredictTimes(experiment, start.At(point)));
      const Likelihood::Columns r = likelihood.Prepare(ResidualContrasts(experiment, times));
      gain = likelihood.LogLikelihood(likelihood.Gram(r, s)(0, 0), s) +
             LogPriorOfValues(start.coordinates(), point) - here;
      if (gain <= 0) continue;
      moved = true;
      fit.point = point;
      fit.time_s = std::move(times);
      // The columns are good enough if the simulator did what they foretold.
      fit.columns = Likelihood::Join(
          r, Likelihood::Pick(fit.columns, std::vector<int>(members.begin() + 1, members.end())));
      break;
    }
    if (!moved) break;
    if (gain < kConverged) {
      judgement = Judge(likelihood, Grams(likelihood, fit.columns), members, start.coordinates(), fit.point);
      break;
    }
    // A full step that came out as foretold needs no further derivatives.
    const Judgement after =
        Judge(likelihood, Grams(likelihood, fit.columns), members, start.coordinates(), fit.point);
    double farthest = 0;  // of what is left to go, in standard errors
    for (int i = 0; i < start.size(); ++i)
      farthest =
          std::max(farthest, std::abs(after.step[i]) / std::sqrt(std::max(after.covariance(i, i), 1e-300)) *
                                 (after.covariance(i, i) > 0));
    if (fraction == 1 && farthest < kSmallStep &&
        std::abs(after.evidence - judgement.evidence) < kConverged) {
      judgement = after;
      break;
    }
  }
  start.MoveTo(fit.point);
  fit.model = std::move(start);
  fit.evidence = judgement.evidence;
  fit.log_likelihood = judgement.log_likelihood;
  fit.surface = judgement.surface;
  fit.sigma_s = judgement.sigma_s;
  fit.covariance = judgement.covariance;
  return fit;
}

}  // namespace touchstone
