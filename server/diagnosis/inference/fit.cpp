#include "server/diagnosis/inference/fit.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/status.h"

namespace touchstone {
namespace {

constexpr double kStep = 0.02;     // of a coordinate's scale, for derivatives
constexpr double kJumpM = 0.3e-3;  // a finger that moves so far within a step has met another face
constexpr double kJumpOverMedian = 200;
constexpr int kMaxHalvings = 5;
constexpr double kConverged = 0.02;  // nats
constexpr double kSmallStep = 0.05;  // standard errors

}  // namespace

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
  ParallelFor(experiment.pool, static_cast<int>(tasks.size()), 1, run);
  for (const absl::Status& status : statuses) TOUCHSTONE_RETURN_IF_ERROR(status);
  if (experiment.cancelled && experiment.cancelled())
    return absl::CancelledError("the diagnosis was cancelled");
  return columns;
}

absl::StatusOr<Fit> FitModel(const Experiment& experiment, FreeModel start, int max_iterations) {
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
    if (start.size() == 0 || iteration == max_iterations) break;

    // Along the step, as far as the likelihood of the best hypothesis really grows.
    const int s = judgement.surface;
    const double here =
        likelihood.LogLikelihood(likelihood.Gram(Likelihood::Pick(fit.columns, {0}), s)(0, 0), s) +
        LogPriorOfValues(start.coordinates(), fit.point);
    double fraction = 1, gain = 0;
    bool moved = false;
    for (int halving = 0; halving <= kMaxHalvings; ++halving, fraction /= 2) {
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
