#include "server/diagnosis/selection/ladder/climb.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/diagnosis/engine/ladder/step_order.h"
#include "server/diagnosis/selection/scatter/declared_noise.h"
#include "server/diagnosis/selection/session/dropouts.h"
#include "server/diagnosis/selection/session/session_order.h"
#include "server/diagnosis/selection/session/time_structure.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::selection {
namespace {

// The steps by their effects' indices in the model without the formula.
std::vector<engine::SelectedStep> StepsWithoutFormula(const SelectionResult& selection) {
  std::vector<engine::SelectedStep> steps = selection.steps;
  for (engine::SelectedStep& step : steps)
    if (selection.formula >= 0 && step.effect > selection.formula) --step.effect;
  return steps;
}

class Climber {
 public:
  Climber(const Workspace& workspace, const SelectionResult& selection)
      : workspace_(workspace), selection_(selection), ladder_(climb_.ladder) {
    climb_.searched = has_formula() ? &selection.without_formula : &selection.fit;
    climb_.steps = StepsWithoutFormula(selection);
  }

  absl::StatusOr<Climb> Run() {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        climb_.before, QualityOfModel(workspace_, selection_.initial_model, *workspace_.input.model));
    TOUCHSTONE_RETURN_IF_ERROR(Improve());
    TOUCHSTONE_RETURN_IF_ERROR(DescribeSteps());
    return std::move(climb_);
  }

 private:
  bool has_formula() const { return selection_.formula >= 0; }

  // The improved model: everything but the formula, fitted without it; its residuals, and the noise floor of the best model.
  absl::Status Improve() {
    const touches::Observations& o = *workspace_.observations;
    TOUCHSTONE_ASSIGN_OR_RETURN(climb_.fit, FitAll(workspace_, *climb_.searched));
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const std::vector<int> superfluous,
        engine::ImproveValues(workspace_.experiment, *climb_.searched, climb_.fit, climb_.fit.covariance,
                              *workspace_.input.model, o.objects, &ladder_));
    TOUCHSTONE_ASSIGN_OR_RETURN(ladder_.prediction, workspace_.predictor->Run(ladder_.improved, true, true));
    ladder_.residuals = touches::Residuals(o, ladder_.prediction);
    std::vector<double>& best = climb_.residuals_with_rest;
    best = ladder_.residuals;
    if (has_formula()) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const engine::Fit whole, FitAll(workspace_, selection_.fit));
      climb_.with_formula = whole.model.base();
      engine::RoundValues(whole, &*climb_.with_formula);
      for (const int index : superfluous)
        climb_.with_formula->effects.erase(climb_.with_formula->effects.begin() + index);
      TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction with,
                                  workspace_.predictor->Run(*climb_.with_formula, false, false));
      TOUCHSTONE_ASSIGN_OR_RETURN(const double error_s, ErrorAsCompared(workspace_, ladder_.improved));
      TOUCHSTONE_ASSIGN_OR_RETURN(const double error_with_s,
                                  ErrorAsCompared(workspace_, *climb_.with_formula));
      if (error_with_s < std::min(error_s, climb_.before.rmse))
        best = touches::Residuals(o, with);
      else
        climb_.with_formula.reset();
    }
    ladder_.noise_floor = NoiseFloorOf(o, best, climb_.fit.model.size());
    AddTimeStructure(o, best, &ladder_.noise_floor);
    ladder_.noise_floor.declared = DeclaredSigma(*workspace_.input.model);
    ladder_.dropouts = DropoutsInWords(o, ladder_.prediction);
    return absl::OkStatus();
  }

  absl::Status DescribeSteps() {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const engine::StepOrder order,
        engine::OrderSteps(workspace_.experiment, {*climb_.searched, selection_.initial_effects}, -1,
                           climb_.steps, climb_.before,
                           [this](const engine::OrderedStep& step, const engine::Quality&) {
                             return QualityOfModel(workspace_, step.fit, ModelWith(step));
                           }));
    climb_.without_gain = order.without_gain;
    for (const engine::OrderedStep& step : order.steps) AddStep(step);
    return absl::OkStatus();
  }

  const model::Model& ModelWith(const engine::OrderedStep& step) const {
    return step.whole ? ladder_.improved : step.fit.model.base();
  }

  void AddStep(const engine::OrderedStep& ordered) {
    AddOrder(ordered.step->effect, &engine::AddStep(climb_.fit, climb_.fit.covariance, *ordered.step,
                                                    ModelWith(ordered), ordered.quality, &ladder_));
  }

  // What belongs to the rig and differs between objects may differ in time; so may sizes and places, which objects have of their
  // own, where they grow from one object to the next.
  void AddOrder(int effect, engine::LadderStep* step) const {
    const model::EffectInstance& instance = climb_.searched->model.base().effects[effect];
    if (!instance.per_object) return;
    const std::string words =
        OrderInWords(*workspace_.observations, climb_.searched->model.OnlyObject(effect), step->parameters,
                     instance.effect->often_per_object);
    if (!words.empty()) engine::AddWords(words, step);
    if (instance.effect->often_per_object) return;
    for (const std::string& other : step->equivalent)
      if (const auto own = effects::Catalogue().Find(other); own != nullptr && own->often_per_object)
        engine::AddWords(absl::StrCat("What belongs to the rig seldom acts on single objects: ", other,
                                      ", which objects have of their own, explains it as well."),
                         step);
  }

  const Workspace& workspace_;
  const SelectionResult& selection_;
  Climb climb_;
  Ladder& ladder_;  // the climb's
};

}  // namespace

absl::StatusOr<engine::Fit> FitAll(const Workspace& workspace, const engine::Fit& fit, int max_iterations) {
  if (!workspace.thinned || fit.hypothesis != 0 || fit.model.size() == 0) return fit;
  const touches::Observations& o = *workspace.observations;
  const touches::Contrasts contrasts = WeighedContrasts(workspace, o, workspace.nominal.time_s);
  const engine::Likelihood likelihood(
      touches::FirstRowsOfObjects(contrasts, static_cast<int>(o.objects.size())), nullptr, 0, nullptr);
  const touches::TouchObservationModel rows(o, *workspace.predictor, contrasts, workspace.nominal.time_s);
  engine::Experiment all = workspace.experiment;
  all.observations = &rows;
  all.likelihood = &likelihood;
  all.pool = nullptr;  // the predictor has the threads
  TOUCHSTONE_ASSIGN_OR_RETURN(engine::Fit whole, engine::FitModel(all, fit.model, max_iterations));
  whole.columns = fit.columns;  // held-out errors come from the search's touches
  return whole;
}

absl::StatusOr<Climb> ClimbSteps(const Workspace& workspace, const SelectionResult& selection) {
  return Climber(workspace, selection).Run();
}

}  // namespace touchstone::diagnosis::selection
