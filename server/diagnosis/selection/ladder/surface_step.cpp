#include "server/diagnosis/selection/ladder/surface_step.h"

#include <algorithm>
#include <cmath>

#include "server/base/numbers/normal.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/selection/ladder/rules.h"
#include "server/diagnosis/selection/surface/surface_map_fit.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::selection {
namespace {

// Size and length, in the units of files. What the bounds of the effect cut off is cut off here too.
std::vector<engine::ParameterEstimate> DescribeSurface(const model::Effect& effect,
                                                       const SurfaceErrorFinding& found) {
  const std::pair<double, double> values[] = {
      {found.rms_m * kMillimetresPerMetre, 1 / std::sqrt(2 * std::max(found.effective_dof, 1.0))},
      {found.length_m * kMillimetresPerMetre, kLadderRules.length_error}};
  std::vector<engine::ParameterEstimate> estimates;
  for (const auto& [value, relative_error] : values) {
    const model::ParameterInfo& parameter = effect.parameters[estimates.size()];
    engine::ParameterEstimate estimate;
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

std::vector<double> SurfaceValues(const model::Effect& effect,
                                  const std::vector<engine::ParameterEstimate>& estimates) {
  std::vector<double> values;
  for (const engine::ParameterEstimate& estimate : estimates) {
    const model::ParameterInfo& parameter = effect.parameters[values.size()];
    // Two per cent of the values stand for their error.
    const double rounded = engine::RoundedTo(estimate.value, 0.02 * estimate.value);
    values.push_back(std::clamp(rounded, parameter.lower, parameter.upper) * kMetresPerMillimetre);
  }
  return values;
}

// Of surface_error, or of the map in its place.
engine::LadderStep SurfaceStepOf(const model::Effect& effect, const SelectionResult& selection,
                                 const SurfaceSupport& support) {
  const SurfaceErrorFinding& found = selection.surface_error;
  const auto unknown = effects::FindByRole(model::EffectRole::kSmoothError);
  engine::LadderStep step;
  step.effect = effect.name;
  step.scope = engine::EffectScope::kObject;
  engine::AddTexts(effect, &step);
  step.probability = std::min(engine::ProbabilityOf(found.gain_nats), support.Probability());
  step.gain_nats = found.gain_nats;
  step.discriminating_measurement = engine::DiscriminatingMeasurement({unknown->name});
  step.parameters = DescribeSurface(*unknown, found);
  return step;
}

// Returns whether a map was asked for and predicts poses that it has not seen.
absl::StatusOr<bool> AddSurfaceMap(const Workspace& workspace, const SelectionResult& selection,
                                   const SurfaceSupport& support, double lack_of_fit_p, Ladder* ladder) {
  const std::vector<model::EffectInstance>& given = workspace.input.model->effects;
  const bool has_map = std::any_of(given.begin(), given.end(), [](const model::EffectInstance& e) {
    return e.effect->surface_map != nullptr;
  });
  if (!workspace.input.with_surface_map || selection.formula >= 0 || has_map ||
      !(support.left_s < support.before_s))
    return false;
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto effect, FitSurfaceMap(workspace, selection.fit, support));
  model::Model with = ladder->improved;
  with.effects.push_back({effect, false, {}, {}});
  TOUCHSTONE_ASSIGN_OR_RETURN(const double rmse_s, ErrorAsCompared(workspace, with));
  if (!(rmse_s < ladder->final.rmse)) return false;
  engine::LadderStep step = SurfaceStepOf(*effect, selection, support);
  step.quality.rmse = rmse_s;
  // Found on the touches of the search, which stand for all.
  step.quality.heldout_rmse = ladder->final.rmse * support.left_s / support.before_s;
  step.quality.lack_of_fit_p = lack_of_fit_p;
  step.words = support.WordsOfMap(step.quality.heldout_rmse);
  step.model = with;
  TOUCHSTONE_ASSIGN_OR_RETURN(ladder->prediction, workspace.predictor->Run(with, true, true));
  ladder->residuals = touches::Residuals(*workspace.observations, ladder->prediction);
  ladder->improved = std::move(with);
  ladder->final = step.quality;
  ladder->steps.push_back(std::move(step));
  return true;
}

}  // namespace

absl::Status AddSurfaceStep(const Workspace& workspace, const SelectionResult& selection,
                            const SurfaceSupport& support, double lack_of_fit_p, Ladder* ladder) {
  ladder->changed = true;
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool mapped,
                              AddSurfaceMap(workspace, selection, support, lack_of_fit_p, ladder));
  if (mapped) return absl::OkStatus();
  const auto effect = effects::FindByRole(model::EffectRole::kSmoothError);
  engine::LadderStep step = SurfaceStepOf(*effect, selection, support);
  step.words = support.Words(ladder->final.rmse);
  // How the bumps lie is not known: the model with them expects what it did without.
  step.quality = ladder->final;
  step.quality.lack_of_fit_p = lack_of_fit_p;
  if (selection.formula < 0) ladder->final.lack_of_fit_p = lack_of_fit_p;
  model::EffectInstance instance;
  instance.effect = effect;
  instance.per_object = true;
  instance.values = SurfaceValues(*effect, step.parameters);
  ladder->improved.effects.push_back(std::move(instance));
  step.model = ladder->improved;
  ladder->steps.push_back(std::move(step));
  return absl::OkStatus();
}

void RefitSurfaceError(const SurfaceErrorFinding& found, Ladder* ladder) {
  for (model::EffectInstance& instance : ladder->improved.effects) {
    if (instance.effect->role != model::EffectRole::kSmoothError) continue;
    engine::RefittedEffect refit{instance.effect->name, DescribeSurface(*instance.effect, found)};
    for (size_t p = 0; p < refit.parameters.size(); ++p)
      refit.parameters[p].before = instance.values[p] * kMillimetresPerMetre;
    instance.values = SurfaceValues(*instance.effect, refit.parameters);
    instance.object_values.clear();
    ladder->refitted.push_back(std::move(refit));
    ladder->values_wrong = true;
    ladder->changed = true;
  }
}

}  // namespace touchstone::diagnosis::selection
