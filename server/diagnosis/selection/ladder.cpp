#include "server/diagnosis/selection/ladder.h"

#include <algorithm>
#include <cmath>

#include "server/base/normal.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/selection/time_structure.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kSurfaceNats = 5;        // evidence that makes a surface error a step by itself
constexpr double kSurfaceWithMisfit = 1;  // ... and where the lack of fit says that something is left
constexpr double kMisfitP = 1e-2;
constexpr double kUnexplainedP = 1e-4;      // of the lack of fit, for a rest without a name
constexpr double kUnexplainedShare = 0.01;  // of the floor that such a rest must add
constexpr double kLengthError = 0.4;        // relative, of a surface error's length: the grid's spacing

// The fit on every touch, where the search saw a part of them and no surface error stands in the way.
absl::StatusOr<inference::Fit> FitAll(const Workspace& workspace, const inference::Fit& fit) {
  if (!workspace.thinned || fit.hypothesis != 0 || fit.model.size() == 0) return fit;
  const touches::Observations& o = *workspace.observations;
  const touches::Contrasts contrasts(o, workspace.nominal.time_s);
  const inference::Likelihood likelihood(
      touches::FirstRowsOfObjects(contrasts, static_cast<int>(o.objects.size())), nullptr, 0, nullptr);
  const touches::TouchObservationModel rows(o, *workspace.predictor, contrasts, workspace.nominal.time_s);
  inference::Experiment all = workspace.experiment;
  all.observations = &rows;
  all.likelihood = &likelihood;
  all.pool = nullptr;  // the predictor has the threads
  TOUCHSTONE_ASSIGN_OR_RETURN(inference::Fit whole, inference::FitModel(all, fit.model));
  whole.columns = fit.columns;  // held-out errors come from the search's touches
  return whole;
}

// The model with only those of its further effects that are in `kept`.
inference::Parameterization Only(const inference::Parameterization& model, int initial_effects,
                                 const std::vector<int>& kept) {
  inference::Parameterization part = model;
  for (int index = static_cast<int>(model.base().effects.size()) - 1; index >= initial_effects; --index)
    if (std::find(kept.begin(), kept.end(), index) == kept.end()) part = part.Without(index);
  return part;
}

void AddTexts(const model::Effect& effect, LadderStep* step) {
  step->meaning = effect.meaning;
  step->check_on_rig = effect.check_on_rig;
  step->remedy = effect.remedy;
}

class LadderBuilder {
 public:
  LadderBuilder(const Workspace& workspace, const SelectionResult& selection)
      : workspace_(workspace), selection_(selection) {}

  absl::StatusOr<Ladder> Build() {
    TOUCHSTONE_RETURN_IF_ERROR(Improve());
    DescribeRefits();
    TOUCHSTONE_RETURN_IF_ERROR(DescribeSteps());
    ladder_.final = QualityOf(workspace_, selection_.without_formula, ladder_.residuals);
    if (SurfaceErrorIsAStep()) AddSurfaceError();
    if (selection_.memory) AddMemoryStep(*selection_.memory, &ladder_);
    AddNoiseSteps(selection_.noise, &ladder_);
    TOUCHSTONE_ASSIGN_OR_RETURN(ladder_.candidates, RankCandidates(workspace_, selection_));
    const bool rest = StructureRemains() || selection_.curve || TimeStructureRemains();
    if (has_formula() || rest) {
      TOUCHSTONE_ASSIGN_OR_RETURN(
          ladder_.unexplained,
          DescribeUnexplained(workspace_, selection_, ladder_.final, ladder_.noise_floor.sigma_s));
      if (TimeStructureRemains())
        NameTimeFirst(*workspace_.observations, ladder_.noise_floor, &*ladder_.unexplained);
    }
    ladder_.verdict = has_formula() || rest    ? Verdict::kUnexplained
                      : !ladder_.steps.empty() ? Verdict::kMissingEffects
                      : ladder_.values_wrong   ? Verdict::kWrongValues
                                               : Verdict::kAdequate;
    if (ladder_.changed && !ladder_.improved.name.empty()) ladder_.improved.name += "_better";
    return std::move(ladder_);
  }

 private:
  bool has_formula() const { return selection_.formula >= 0; }

  // The improved model: everything but the formula; its residuals, and the noise floor.
  absl::Status Improve() {
    const touches::Observations& o = *workspace_.observations;
    TOUCHSTONE_ASSIGN_OR_RETURN(fit_, FitAll(workspace_, selection_.fit));
    model::Model whole = fit_.model.base();
    RoundValues(fit_, &whole);
    ladder_.improved = whole;
    if (has_formula()) ladder_.improved.effects.erase(ladder_.improved.effects.begin() + selection_.formula);
    ladder_.changed = !selection_.steps.empty();
    TOUCHSTONE_ASSIGN_OR_RETURN(ladder_.prediction, workspace_.predictor->Run(ladder_.improved, true, true));
    ladder_.residuals = touches::Residuals(o, ladder_.prediction);
    std::vector<double> best = ladder_.residuals;
    if (has_formula()) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction with,
                                  workspace_.predictor->Run(whole, false, false));
      best = touches::Residuals(o, with);
    }
    ladder_.noise_floor = NoiseFloorOf(o, best, fit_.model.size());
    AddTimeStructure(o, best, &ladder_.noise_floor);
    return absl::OkStatus();
  }

  void DescribeRefits() {
    const model::Model& before = *workspace_.input.model;
    const inference::Parameterization initial(before, workspace_.observations->objects);
    for (int index = 0; index < static_cast<int>(before.effects.size()); ++index) {
      if (!fit_.model.IsFree(index)) continue;
      const std::vector<inference::ParameterEstimate> old =
          initial.Describe(index, Eigen::VectorXd(), Eigen::MatrixXd());
      RefittedEffect refit;
      refit.effect = inference::NameOf(*before.effects[index].effect);
      refit.parameters = fit_.model.Describe(index, fit_.point, fit_.covariance);
      for (size_t j = 0; j < refit.parameters.size() && j < old.size(); ++j)
        refit.parameters[j].before = old[j].value;
      ladder_.refitted.push_back(std::move(refit));
      ladder_.values_wrong = true;
      ladder_.changed = true;
    }
  }

  // Steps in the order in which they explain most.
  absl::Status DescribeSteps() {
    std::vector<int> kept, open;
    for (const SelectedStep& step : selection_.steps) open.push_back(step.effect);
    while (!open.empty()) {
      absl::StatusOr<inference::Fit> next = absl::NotFoundError("");
      size_t chosen = 0;
      for (size_t j = 0; j < open.size(); ++j) {
        TOUCHSTONE_ASSIGN_OR_RETURN(inference::Fit trial, FitWith(kept, open[j], open.size() == 1));
        if (next.ok() && trial.log_evidence <= next->log_evidence) continue;
        next = std::move(trial);
        chosen = j;
      }
      kept.push_back(open[chosen]);
      open.erase(open.begin() + static_cast<long>(chosen));
      TOUCHSTONE_RETURN_IF_ERROR(DescribeStep(kept.back(), *next));
    }
    return absl::OkStatus();
  }

  // The fit with the steps kept so far and one more; the last one is the whole fit.
  absl::StatusOr<inference::Fit> FitWith(std::vector<int> kept, int further, bool last) const {
    if (last && !has_formula()) return selection_.fit;
    kept.push_back(further);
    return inference::FitModel(workspace_.experiment,
                               Only(selection_.fit.model, selection_.initial_effects, kept));
  }

  absl::Status DescribeStep(int index, const inference::Fit& with_it) {
    const SelectedStep& from = *std::find_if(selection_.steps.begin(), selection_.steps.end(),
                                             [&](const SelectedStep& s) { return s.effect == index; });
    const model::EffectInstance& instance = fit_.model.base().effects[index];
    LadderStep step;
    step.effect = inference::NameOf(*instance.effect);
    step.scope = instance.per_object ? EffectScope::kObject : EffectScope::kRig;
    AddTexts(*instance.effect, &step);
    step.probability = from.probability;
    step.gain_nats = from.gain_nats;
    step.parameters = fit_.model.Describe(index, fit_.point, fit_.covariance);
    std::vector<std::string> equivalent = {step.effect};
    for (const CompetingEffect& other : from.competing)
      if (other.equivalent && std::find(equivalent.begin(), equivalent.end(), other.name) == equivalent.end())
        equivalent.push_back(other.name);
    step.equivalent.assign(equivalent.begin() + 1, equivalent.end());
    if (!step.equivalent.empty()) {
      step.discriminating_measurement = DiscriminatingMeasurement(equivalent);
      ladder_.confounded.push_back({equivalent, step.discriminating_measurement});
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction prediction,
                                workspace_.predictor->Run(with_it.model.base(), false, false));
    step.quality = QualityOf(workspace_, with_it, touches::Residuals(*workspace_.observations, prediction));
    ladder_.steps.push_back(std::move(step));
    return absl::OkStatus();
  }

  // Bumps of the surface may be the last step.
  bool SurfaceErrorIsAStep() const {
    const std::vector<model::EffectInstance>& effects = workspace_.input.model->effects;
    const bool had = std::any_of(effects.begin(), effects.end(), [](const model::EffectInstance& e) {
      return e.effect->role == model::EffectRole::kSmoothError;
    });
    const double gain_nats = selection_.surface_error.gain_nats;
    const bool misfit = ladder_.final.lack_of_fit_p < kMisfitP;
    // Where a curve of one covariate or a wander takes part, bumps are no explanation of what is left.
    return !had && !selection_.curve && !selection_.memory && selection_.fit.hypothesis != 0 &&
           (gain_nats > kSurfaceNats || (misfit && gain_nats > kSurfaceWithMisfit));
  }

  void AddSurfaceError() {
    const SurfaceErrorFinding& found = selection_.surface_error;
    const auto effect = effects::FindByRole(model::EffectRole::kSmoothError);
    LadderStep step;
    step.effect = effect->name;
    step.scope = EffectScope::kObject;
    AddTexts(*effect, &step);
    step.probability = 1 / (1 + std::exp(-found.gain_nats));
    step.gain_nats = found.gain_nats;
    step.discriminating_measurement = DiscriminatingMeasurement({effect->name});
    const double rms_mm = found.rms_m * kMillimetresPerMetre,
                 length_mm = found.length_m * kMillimetresPerMetre;
    const auto add = [&](const model::ParameterInfo& parameter, double value, double relative_error) {
      inference::ParameterEstimate estimate;
      estimate.name = parameter.name;
      estimate.unit = std::string(UnitSymbol(parameter.unit));
      estimate.value = value;
      estimate.std_error = value * relative_error;
      estimate.lower = value * std::max(0.0, 1 - kNormalQuantile975 * relative_error);
      estimate.upper = value * (1 + kNormalQuantile975 * relative_error);
      step.parameters.push_back(std::move(estimate));
    };
    add(effect->parameters[0], rms_mm, 1 / std::sqrt(2 * std::max(found.effective_dof, 1.0)));
    add(effect->parameters[1], length_mm, kLengthError);
    step.quality = QualityWithoutSurface(workspace_, selection_.fit);
    if (!has_formula()) ladder_.final = step.quality;
    ladder_.steps.push_back(std::move(step));
    model::EffectInstance instance;
    instance.effect = effect;
    instance.per_object = true;
    // Two per cent of the values stand for their error.
    instance.values = {RoundedTo(rms_mm, found.rms_m * 20) * kMetresPerMillimetre,
                       RoundedTo(length_mm, found.length_m * 20) * kMetresPerMillimetre};
    ladder_.improved.effects.push_back(std::move(instance));
    ladder_.changed = true;
  }

  bool StructureRemains() const {
    return !has_formula() && ladder_.final.lack_of_fit_p < kUnexplainedP &&
           ladder_.final.rmse_s * kMicrosecondsPerSecond >
               (1 + kUnexplainedShare) * (ladder_.noise_floor.sigma_s * kMicrosecondsPerSecond);
  }

  // Repeats that share a course in time are not noise.
  bool TimeStructureRemains() const { return !selection_.memory && SharesTime(ladder_.noise_floor); }

  const Workspace& workspace_;
  const SelectionResult& selection_;
  inference::Fit fit_;  // on all touches
  Ladder ladder_;
};

}  // namespace

absl::StatusOr<Ladder> BuildLadder(const Workspace& workspace, const SelectionResult& selection) {
  return LadderBuilder(workspace, selection).Build();
}

}  // namespace touchstone::diagnosis::selection
