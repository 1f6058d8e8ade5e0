#include "server/diagnosis/selection/ladder.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "server/base/normal.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/selection/declared_noise.h"
#include "server/diagnosis/selection/doubts.h"
#include "server/diagnosis/selection/dropouts.h"
#include "server/diagnosis/selection/round_structure.h"
#include "server/diagnosis/selection/surface_support.h"
#include "server/diagnosis/selection/time_structure.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kSurfaceNats = 5;        // evidence that asks for a surface error by itself
constexpr double kSurfaceWithMisfit = 1;  // ... and where the lack of fit says that something is left
constexpr double kMisfitP = 1e-2;
constexpr double kUnexplainedP = 1e-4;      // of the lack of fit, for a rest without a name
constexpr double kUnexplainedShare = 0.01;  // of the floor that such a rest must add
constexpr double kLengthError = 0.4;        // relative, of a surface error's length: the grid's spacing
constexpr double kElsewhereNats = 5;  // of what is no surface, for a rest that a lack of fit does not show
constexpr double kZeroErrors = 2;     // standard errors of a value that may be zero
constexpr double kZero = 1e-6;        // ... or this share of the typical size
constexpr double kSameSurface =
    2.5;  // ratio of two sizes of bumps that may be the same: an object has few of them

// The fit on every touch, where the search saw a part of them and no surface error stands in the way.
absl::StatusOr<inference::Fit> FitAll(const Workspace& workspace, const inference::Fit& fit) {
  if (!workspace.thinned || fit.hypothesis != 0 || fit.model.size() == 0) return fit;
  const touches::Observations& o = *workspace.observations;
  const touches::Contrasts contrasts = WeighedContrasts(workspace, o, workspace.nominal.time_s);
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
    doubts_ = DoubtsOf(fit_, selection_, &ladder_);
    QuestionRounds();
    ladder_.final = QualityOf(workspace_, selection_.without_formula, ladder_.residuals);
    left_ = ladder_.final;
    TOUCHSTONE_RETURN_IF_ERROR(SetErrorsAsCompared(workspace_, ladder_.improved, &ladder_.final));
    TOUCHSTONE_RETURN_IF_ERROR(JudgeSurface());
    if (selection_.memory) AddMemoryStep(*selection_.memory, &ladder_);
    // Where the object lay elsewhere in every round, what the scatter looks like is no property of the sensor.
    if (!doubts_.remounted) AddNoiseSteps(selection_.noise, &ladder_);
    if (!selection_.memory && !doubts_.remounted) RemoveAbsentMemory(*workspace_.observations, &ladder_);
    TOUCHSTONE_ASSIGN_OR_RETURN(ladder_.candidates, RankCandidates(workspace_, selection_));
    const bool rest =
        StructureRemains() || selection_.curve || TimeStructureRemains() || unplaced_ || doubts_.any();
    if (has_formula() || rest) {
      TOUCHSTONE_ASSIGN_OR_RETURN(
          ladder_.unexplained,
          DescribeUnexplained(workspace_, selection_, ladder_.final, ladder_.noise_floor.sigma_s));
      if (TimeStructureRemains())
        NameTimeFirst(*workspace_.observations, ladder_.noise_floor, &*ladder_.unexplained);
      if (doubts_.remounted) NameRoundFirst(rounds_, &*ladder_.unexplained);
      ladder_.unexplained->words = WordsOfRest();
      Doubt(ExplainedShare(), doubts_, &ladder_);
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
    TOUCHSTONE_RETURN_IF_ERROR(RemoveSuperfluous());
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
    ladder_.noise_floor.declared_s = DeclaredSigma(*workspace_.input.model);
    ladder_.dropouts = DropoutsInWords(o, ladder_.prediction);
    return absl::OkStatus();
  }

  // Effects of the given model whose values, set free, are zero as far as the data can tell.
  absl::Status RemoveSuperfluous() {
    for (int index = static_cast<int>(workspace_.input.model->effects.size()) - 1; index >= 0; --index) {
      if (!fit_.model.IsFree(index)) continue;
      const model::Effect& effect = *fit_.model.base().effects[index].effect;
      bool zero = true;
      for (const inference::ParameterEstimate& e : fit_.model.Describe(index, fit_.point, fit_.covariance))
        for (const model::ParameterInfo& parameter : effect.parameters)
          if (parameter.name == e.name)
            zero &=
                !parameter.reciprocal && std::abs(e.value - parameter.neutral) <=
                                             std::max(kZeroErrors * e.std_error, kZero * parameter.typical);
      if (!zero) continue;
      TOUCHSTONE_ASSIGN_OR_RETURN(
          const inference::Fit without,
          inference::FitModel(workspace_.experiment, selection_.fit.model.Without(index)));
      if (without.log_evidence < selection_.fit.log_evidence) continue;
      superfluous_.push_back(index);
      ladder_.superfluous.push_back(inference::NameOf(effect));
      ladder_.improved.effects.erase(ladder_.improved.effects.begin() + index);
      ladder_.values_wrong = true;
      ladder_.changed = true;
    }
    return absl::OkStatus();
  }

  void DescribeRefits() {
    const model::Model& before = *workspace_.input.model;
    const inference::Parameterization initial(before, workspace_.observations->objects);
    for (int index = 0; index < static_cast<int>(before.effects.size()); ++index) {
      if (!fit_.model.IsFree(index)) continue;
      if (std::find(superfluous_.begin(), superfluous_.end(), index) != superfluous_.end()) continue;
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
    for (const CompetingEffect& other : from.competing)
      if (other.stopped)
        step.words += absl::StrCat(step.words.empty() ? "" : " ", other.name,
                                   " would do as well with a value beyond its bound.");
    if (!step.equivalent.empty()) {
      step.discriminating_measurement = DiscriminatingMeasurement(equivalent);
      ladder_.confounded.push_back({equivalent, step.discriminating_measurement});
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction prediction,
                                workspace_.predictor->Run(with_it.model.base(), false, false));
    step.quality = QualityOf(workspace_, with_it, touches::Residuals(*workspace_.observations, prediction));
    step.model = with_it.model.base();
    TOUCHSTONE_RETURN_IF_ERROR(SetErrorsAsCompared(workspace_, step.model, &step.quality));
    ladder_.steps.push_back(std::move(step));
    return absl::OkStatus();
  }

  const model::EffectInstance* GivenSurface() const {
    for (const model::EffectInstance& e : workspace_.input.model->effects)
      if (e.effect->role == model::EffectRole::kSmoothError) return &e;
    return nullptr;
  }

  // Bumps of the surface may be the last step, where nothing else accounts for them.
  absl::Status JudgeSurface() {
    const double gain_nats = selection_.surface_error.gain_nats;
    const bool misfit = left_.lack_of_fit_p < kMisfitP;
    const bool asked = selection_.fit.hypothesis != 0 &&
                       (gain_nats > kSurfaceNats || (misfit && gain_nats > kSurfaceWithMisfit));
    // Where a curve of one covariate or a wander takes part, bumps are no explanation of what is left.
    if (!asked || doubts_.any() || selection_.curve || selection_.memory) return absl::OkStatus();
    TOUCHSTONE_ASSIGN_OR_RETURN(support_, FindSurfaceSupport(workspace_, selection_.fit));
    const model::EffectInstance* given = GivenSurface();
    const double rms_m = selection_.surface_error.rms_m;
    if (given != nullptr && rms_m < kSameSurface * given->values[0]) {
      // The model says that surfaces are as wrong as this.
      left_.lack_of_fit_p = QualityWithoutSurface(workspace_, selection_.fit).lack_of_fit_p;
      return absl::OkStatus();
    }
    if (support_.IsSurface()) {
      left_.lack_of_fit_p = QualityWithoutSurface(workspace_, selection_.fit).lack_of_fit_p;
      if (given == nullptr)
        AddSurfaceError();
      else
        RefitSurfaceError();
      return absl::OkStatus();
    }
    unplaced_ = gain_nats > kSurfaceNats &&
                std::max(support_.curve_nats, support_.finger_field_nats) > kElsewhereNats;
    return absl::OkStatus();
  }

  // Size and length, in the units of files. What the bounds of the effect cut off is cut off here too.
  std::vector<inference::ParameterEstimate> DescribeSurface(const model::Effect& effect) const {
    const SurfaceErrorFinding& found = selection_.surface_error;
    const std::pair<double, double> values[] = {
        {found.rms_m * kMillimetresPerMetre, 1 / std::sqrt(2 * std::max(found.effective_dof, 1.0))},
        {found.length_m * kMillimetresPerMetre, kLengthError}};
    std::vector<inference::ParameterEstimate> estimates;
    for (const auto& [value, relative_error] : values) {
      const model::ParameterInfo& parameter = effect.parameters[estimates.size()];
      inference::ParameterEstimate estimate;
      estimate.name = parameter.name;
      estimate.unit = std::string(UnitSymbol(parameter.unit));
      estimate.value = std::clamp(value, parameter.lower, parameter.upper);
      estimate.std_error = value * relative_error;
      estimate.lower = estimate.value * std::max(0.0, 1 - kNormalQuantile975 * relative_error);
      estimate.upper = std::min(parameter.upper, estimate.value * (1 + kNormalQuantile975 * relative_error));
      estimates.push_back(std::move(estimate));
    }
    return estimates;
  }

  static std::vector<double> SurfaceValues(const model::Effect& effect,
                                           const std::vector<inference::ParameterEstimate>& estimates) {
    std::vector<double> values;
    for (const inference::ParameterEstimate& estimate : estimates) {
      const model::ParameterInfo& parameter = effect.parameters[values.size()];
      // Two per cent of the values stand for their error.
      const double rounded = RoundedTo(estimate.value, 0.02 * estimate.value);
      values.push_back(std::clamp(rounded, parameter.lower, parameter.upper) * kMetresPerMillimetre);
    }
    return values;
  }

  void AddSurfaceError() {
    const SurfaceErrorFinding& found = selection_.surface_error;
    const auto effect = effects::FindByRole(model::EffectRole::kSmoothError);
    LadderStep step;
    step.effect = effect->name;
    step.scope = EffectScope::kObject;
    AddTexts(*effect, &step);
    step.probability = ProbabilityOf(found.gain_nats);
    step.gain_nats = found.gain_nats;
    step.discriminating_measurement = DiscriminatingMeasurement({effect->name});
    step.parameters = DescribeSurface(*effect);
    step.words = support_.Words(ladder_.final.rmse_s);
    // How the bumps lie is not known: the model with them expects what it did without.
    step.quality = ladder_.final;
    step.quality.lack_of_fit_p = left_.lack_of_fit_p;
    if (!has_formula()) ladder_.final.lack_of_fit_p = left_.lack_of_fit_p;
    model::EffectInstance instance;
    instance.effect = effect;
    instance.per_object = true;
    instance.values = SurfaceValues(*effect, step.parameters);
    ladder_.improved.effects.push_back(std::move(instance));
    step.model = ladder_.improved;
    ladder_.steps.push_back(std::move(step));
    ladder_.changed = true;
  }

  void RefitSurfaceError() {
    for (model::EffectInstance& instance : ladder_.improved.effects) {
      if (instance.effect->role != model::EffectRole::kSmoothError) continue;
      RefittedEffect refit{instance.effect->name, DescribeSurface(*instance.effect)};
      for (size_t p = 0; p < refit.parameters.size(); ++p)
        refit.parameters[p].before = instance.values[p] * kMillimetresPerMetre;
      instance.values = SurfaceValues(*instance.effect, refit.parameters);
      instance.object_values.clear();
      ladder_.refitted.push_back(std::move(refit));
      ladder_.values_wrong = true;
      ladder_.changed = true;
    }
  }

  // Whether repeats agree within rounds: a curve of time or a wander would look alike.
  void QuestionRounds() {
    if (selection_.curve || selection_.memory) return;
    const double sigma_s = ladder_.noise_floor.sigma_s;
    rounds_ = FindRoundStructure(*workspace_.observations, ladder_.prediction, ladder_.residuals);
    if (!SharesRounds(rounds_, sigma_s)) return;
    doubts_.remounted = true;
    doubts_.words = RoundsInWords(rounds_, sigma_s);
  }

  bool StructureRemains() const {
    // Under a wander repeats are alike by chance, and the test of their scatter does not hold.
    return !has_formula() && !selection_.memory && left_.lack_of_fit_p < kUnexplainedP &&
           left_.rmse_s > (1 + kUnexplainedShare) * ladder_.noise_floor.sigma_s;
  }

  std::string WordsOfRest() const { return unplaced_ ? support_.WordsOfRest() : doubts_.words; }

  // Of the mean square error that is no noise, what the steps take away.
  double ExplainedShare() const {
    const double floor_s2 = ladder_.noise_floor.sigma_s * ladder_.noise_floor.sigma_s;
    const touches::Observations& o = *workspace_.observations;
    const double before_s2 =
        std::pow(touches::Rmse(o, touches::Residuals(o, workspace_.nominal)), 2) - floor_s2;
    const double after_s2 = left_.rmse_s * left_.rmse_s - floor_s2;
    return before_s2 > 0 ? std::clamp(1 - after_s2 / before_s2, 0.0, 1.0) : 0;
  }

  // Repeats that share a course in time are not noise.
  bool TimeStructureRemains() const { return !selection_.memory && SharesTime(ladder_.noise_floor); }

  const Workspace& workspace_;
  const SelectionResult& selection_;
  inference::Fit fit_;            // on all touches
  Quality left_;                  // on the touches that the fits used: what the verdict is about
  std::vector<int> superfluous_;  // effects of the given model
  Doubts doubts_;
  RoundStructure rounds_;
  SurfaceSupport support_;
  bool unplaced_ = false;  // a misfit repeats with the pose, but not with the place on the surface
  Ladder ladder_;
};

}  // namespace

absl::StatusOr<Ladder> BuildLadder(const Workspace& workspace, const SelectionResult& selection) {
  return LadderBuilder(workspace, selection).Build();
}

}  // namespace touchstone::diagnosis::selection
