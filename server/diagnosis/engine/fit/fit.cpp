#include "server/diagnosis/engine/fit/fit.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "server/base/status.h"
#include "server/diagnosis/engine/fit/rules.h"

namespace touchstone::diagnosis::engine {
namespace {

// One simulation with all parameters of one shape moved; writes their columns.
absl::Status DifferentiateShape(const Experiment& experiment, const Parameterization& model,
                                const Eigen::VectorXd& point, const std::vector<double>& predicted,
                                const std::vector<int>& members, int first, Eigen::MatrixXd* columns) {
  const ObservationModel& observations = *experiment.observations;
  Eigen::VectorXd moved = point;
  std::vector<double> steps;
  for (const int i : members) {
    const FreeParameter& c = model.parameters()[i];
    double step = observations.DerivativeStep() * c.scale;
    if (point[i] + step > c.upper) step = -step;
    moved[i] += step;
    steps.push_back(step);
  }
  const absl::StatusOr<std::vector<double>> prediction =
      observations.PredictNear(model.At(moved), model.At(point), predicted);
  if (!prediction.ok()) return prediction.status();
  const Eigen::VectorXd column = observations.Change(predicted, *prediction);
  for (size_t j = 0; j < members.size(); ++j) {
    const int i = members[j];
    const std::string& object = model.parameters()[i].object;
    if (object.empty()) {
      columns->col(i - first) = column / steps[j];
      continue;
    }
    const std::vector<std::string>& groups = observations.groups();
    const int group = static_cast<int>(std::find(groups.begin(), groups.end(), object) - groups.begin());
    const int begin_row = observations.FirstRowOfGroup(group);
    const int rows = observations.FirstRowOfGroup(group + 1) - begin_row;
    columns->col(i - first).segment(begin_row, rows) = column.segment(begin_row, rows) / steps[j];
  }
  return absl::OkStatus();
}

// Of the parabola through no step and two steps, one twice as long as the other, that gain so much: whether it promises
// nothing between. A loss that does not grow like a parabola promises anything.
bool PromisesNothing(double gain, double gain_of_half) {
  const double slope = 4 * gain_of_half - gain, curvature = gain - slope;
  return curvature < 0 && (slope <= 0 || slope * slope < -4 * curvature * kFitRules.converged);
}

// One fit under way: where it stands, and what the columns there say.
class GaussNewton {
 public:
  GaussNewton(const Experiment& experiment, const Parameterization& model, Fit* fit)
      : experiment_(experiment), model_(model), fit_(fit), members_(model.size() + 1) {
    std::iota(members_.begin(), members_.end(), 0);
    for (const FreeParameter& parameter : model_.parameters())
      rough_.push_back(
          experiment_.observations->HasRoughDerivatives(*model_.base().effects[parameter.effect].effect));
    has_rough_derivatives_ = std::find(rough_.begin(), rough_.end(), true) != rough_.end();
    updates_ = experiment.update_derivatives &&
               std::count(rough_.begin(), rough_.end(), false) >= kFitRules.min_updated;
  }

  // Whether the derivatives behind a step are those of the step before, updated.
  bool updates() const { return updates_; }

  absl::Status Begin() {
    fit_->point = model_.Clip(model_.Start());
    TOUCHSTONE_ASSIGN_OR_RETURN(fit_->predicted, experiment_.observations->Predict(model_.At(fit_->point)));
    return absl::OkStatus();
  }

  absl::Status Linearise() { return LineariseFrom(0, Eigen::MatrixXd(experiment_.likelihood->rows(), 0)); }

  // The derivatives of the first parameters are those of a fit of these alone, where it predicts the same.
  absl::Status LineariseLike(const Fit& part) {
    const int known = part.model.size();
    const bool same = known <= model_.size() && part.columns.values.cols() == known + 1 &&
                      part.point == fit_->point.head(known) && part.predicted == fit_->predicted;
    return same ? LineariseFrom(known, part.columns.values.rightCols(known)) : Linearise();
  }

  LaplaceEvidence Evidence() const {
    return ComputeLaplaceEvidence(*experiment_.likelihood, Grams(*experiment_.likelihood, fit_->columns),
                                  members_, model_.parameters(), fit_->point);
  }

  struct Step {
    bool moved = false;
    double fraction = 1;  // of the proposed step
    double gain = 0;      // of log likelihood and prior, nats
  };

  // Along the step, as far as the likelihood of the best hypothesis really grows.
  absl::StatusOr<Step> MoveAlong(const LaplaceEvidence& evidence) {
    const int s = evidence.hypothesis;
    const double here = LogPosterior(Likelihood::Pick(fit_->columns, {0}), s, fit_->point);
    Step step;
    for (int halving = 0; halving <= kFitRules.max_halvings; ++halving, step.fraction /= 2) {
      const Eigen::VectorXd point = model_.Clip(fit_->point + step.fraction * evidence.step);
      TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<double> predicted,
                                  experiment_.observations->Predict(model_.At(point)));
      const Likelihood::Columns r =
          experiment_.likelihood->Prepare(experiment_.observations->Residual(predicted));
      const double longer_gain = step.gain;
      step.gain = LogPosterior(r, s, point) - here;
      if (step.gain <= 0) {
        // Rough derivatives may lead where nothing grows, however short the step.
        if (has_rough_derivatives_ && halving > 0 && PromisesNothing(longer_gain, step.gain)) break;
        continue;
      }
      step.moved = true;
      if (updates_) {
        fit_->columns = experiment_.likelihood->Prepare(UpdatedColumns(point, predicted, r.values));
      } else {
        // The old derivatives are good enough if the simulator did what they predicted.
        fit_->columns = Likelihood::Join(
            r, Likelihood::Pick(fit_->columns, std::vector<int>(members_.begin() + 1, members_.end())));
      }
      fit_->point = point;
      fit_->predicted = std::move(predicted);
      return step;
    }
    return step;
  }

  // The longest way that is left to go, in standard errors.
  double DistanceLeft(const LaplaceEvidence& evidence) const {
    double farthest = 0;
    for (int i = 0; i < model_.size(); ++i)
      farthest = std::max(farthest, std::abs(evidence.step[i]) /
                                        std::sqrt(std::max(evidence.covariance(i, i), 1e-300)) *
                                        (evidence.covariance(i, i) > 0));
    return farthest;
  }

 private:
  // Simulates the derivatives from parameter `first` on.
  absl::Status LineariseFrom(int first, const Eigen::MatrixXd& known) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::MatrixXd derivatives,
                                Derivatives(experiment_, model_, fit_->point, fit_->predicted, first));
    Eigen::MatrixXd values(experiment_.likelihood->rows(), model_.size() + 1);
    values << experiment_.observations->Residual(fit_->predicted), known, derivatives;
    fit_->columns = experiment_.likelihood->Prepare(values);
    return absl::OkStatus();
  }

  // The residual at `point`, and derivatives that predict from there what the way to it has changed: Broyden's rank-one
  // update, in units of the parameters' scales. Rough derivatives stay.
  Eigen::MatrixXd UpdatedColumns(const Eigen::VectorXd& point, const std::vector<double>& predicted,
                                 const Eigen::MatrixXd& residual) const {
    Eigen::MatrixXd values = fit_->columns.values;
    const Eigen::VectorXd step = point - fit_->point;
    const Eigen::VectorXd missed =
        experiment_.observations->Change(fit_->predicted, predicted) - values.rightCols(model_.size()) * step;
    Eigen::VectorXd scaled = Eigen::VectorXd::Zero(model_.size());
    for (int i = 0; i < model_.size(); ++i)
      if (!rough_[i]) scaled[i] = step[i] / model_.parameters()[i].scale;
    if (const double squares = scaled.squaredNorm(); squares > 0)
      for (int i = 0; i < model_.size(); ++i)
        values.col(1 + i) += missed * (scaled[i] / (squares * model_.parameters()[i].scale));
    values.col(0) = residual;
    return values;
  }

  double LogPosterior(const Likelihood::Columns& residual, int s, const Eigen::VectorXd& point) const {
    const Likelihood& likelihood = *experiment_.likelihood;
    return likelihood.LogLikelihood(likelihood.Gram(residual, s)(0, 0), s) +
           LogPriorOfValues(model_.parameters(), point);
  }

  const Experiment& experiment_;
  const Parameterization& model_;
  Fit* fit_;
  std::vector<int> members_;
  std::vector<bool> rough_;  // by parameter: ObservationModel::HasRoughDerivatives
  bool has_rough_derivatives_ = false, updates_ = false;
};

}  // namespace

absl::StatusOr<Eigen::MatrixXd> Derivatives(const Experiment& experiment, const Parameterization& model,
                                            const Eigen::VectorXd& point,
                                            const std::vector<double>& predicted, int first) {
  // One simulation per shape: parameters that differ by object only are moved together.
  std::map<int, std::vector<int>> shapes;
  for (int i = first; i < model.size(); ++i) shapes[model.parameters()[i].shape].push_back(i);
  std::vector<std::vector<int>> tasks;
  for (auto& [shape, members] : shapes) tasks.push_back(std::move(members));

  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(experiment.observations->rows(), model.size() - first);
  std::vector<absl::Status> statuses(tasks.size());
  const auto run = [&](int begin, int end) {
    for (int task = begin; task < end; ++task) {
      if (experiment.cancelled && experiment.cancelled()) continue;
      statuses[task] = DifferentiateShape(experiment, model, point, predicted, tasks[task], first, &columns);
    }
  };
  ParallelFor(experiment.pool, static_cast<int>(tasks.size()), 1, run);
  for (const absl::Status& status : statuses) TOUCHSTONE_RETURN_IF_ERROR(status);
  if (experiment.cancelled && experiment.cancelled())
    return absl::CancelledError("the diagnosis was cancelled");
  return columns;
}

absl::StatusOr<Fit> FitModel(const Experiment& experiment, Parameterization start, int max_iterations,
                             const Fit* part) {
  Fit fit;
  GaussNewton search(experiment, start, &fit);
  TOUCHSTONE_RETURN_IF_ERROR(search.Begin());
  LaplaceEvidence evidence;
  bool simulate = true;  // the derivatives, for the next step
  for (int iteration = 0;; ++iteration) {
    const bool like_part = iteration == 0 && part != nullptr && experiment.update_derivatives;
    if (simulate) TOUCHSTONE_RETURN_IF_ERROR(like_part ? search.LineariseLike(*part) : search.Linearise());
    const bool simulated = simulate;
    evidence = search.Evidence();
    if (start.size() == 0 || iteration == max_iterations ||
        search.DistanceLeft(evidence) < experiment.near_enough)
      break;
    TOUCHSTONE_ASSIGN_OR_RETURN(const GaussNewton::Step step, search.MoveAlong(evidence));
    // Derivatives that were updated may lead nowhere, or end a fit too early: simulated ones, or those of `part`, have the last
    // word.
    if (!step.moved && simulated) break;
    simulate = !search.updates() || !step.moved;
    if (!step.moved) continue;
    const LaplaceEvidence after = search.Evidence();
    // A full step that ended where the linearised prediction said needs no further derivatives.
    const bool as_predicted = step.fraction == 1 && search.DistanceLeft(after) < kFitRules.small_step &&
                              std::abs(after.log_evidence - evidence.log_evidence) < kFitRules.converged;
    if (step.gain >= kFitRules.converged && !as_predicted) continue;
    if (simulated) {
      evidence = after;
      break;
    }
    simulate = true;
  }
  start.MoveTo(fit.point);
  fit.model = std::move(start);
  fit.log_evidence = evidence.log_evidence;
  fit.log_likelihood = evidence.log_likelihood;
  fit.hypothesis = evidence.hypothesis;
  fit.sigma = evidence.sigma;
  fit.covariance = evidence.covariance;
  return fit;
}

}  // namespace touchstone::diagnosis::engine
