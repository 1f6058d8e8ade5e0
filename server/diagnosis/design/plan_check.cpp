#include "server/diagnosis/design/plan_check.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/diagnosis/selection/candidates.h"
#include "server/diagnosis/selection/scatter/declared_noise.h"

namespace touchstone::diagnosis::design {
namespace {

constexpr char kAsItIs[] = "the model as it is";

// Standard deviation of one finger's time under the model's noise, s: as it says, or as a draw of every touch scatters.
absl::StatusOr<double> NoiseOf(const selection::Workspace& workspace) {
  const model::Model& model = *workspace.input.model;
  if (const double declared = selection::DeclaredSigma(model); declared > 0) return declared;
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> drawn,
                              workspace.predictor->Draw(model, workspace.input.seed));
  touches::Observations reported = *workspace.observations;
  reported.time_s = drawn;
  const double sigma_s = touches::Rmse(reported, touches::Residuals(reported, workspace.nominal));
  if (sigma_s > 0) return sigma_s;
  return absl::InvalidArgumentError(
      absl::StrCat("the model '", model.name,
                   "' has no noise, and without noise every effect is found at "
                   "any size: add gaussian_noise to the model (touchstone model "
                   "add MODEL gaussian_noise sigma_us=5000), or give `touchstone "
                   "check` the noise of one finger's time (--noise 5000, in us)"));
}

absl::Status CheckQuestion(const PlanQuestion& question) {
  if (question.improve > 0 && question.find.empty() == question.between.empty())
    return absl::InvalidArgumentError(
        "which touches help most depends on the question: find (one effect) or between (two effects) was "
        "expected");
  if (question.improve == 0 && !(question.find.empty() && question.between.empty()))
    return absl::InvalidArgumentError("improve = 0: how many touches to propose was expected");
  if (!question.between.empty() &&
      (question.between.size() != 2 || question.between[0] == question.between[1]))
    return absl::InvalidArgumentError(absl::StrCat("between: '", absl::StrJoin(question.between, ","),
                                                   "': two different effects were expected"));
  return absl::OkStatus();
}

// Of one effect that the plan can show, the value that it shows best.
absl::StatusOr<engine::DetectableValue> BestOf(const std::vector<engine::DetectableValue>& values,
                                               const std::string& effect) {
  const engine::DetectableValue* best = nullptr;
  std::vector<std::string> names;
  for (const engine::DetectableValue& value : values) {
    if (names.empty() || names.back() != value.effect->name) names.push_back(value.effect->name);
    if (value.effect->name != effect || value.with_effect == nullptr) continue;
    if (best == nullptr || value.power_at_typical > best->power_at_typical) best = &value;
  }
  if (best != nullptr) return *best;
  if (std::find(names.begin(), names.end(), effect) != names.end())
    return absl::InvalidArgumentError(absl::StrCat(
        "'", effect, "' changes no touch of this plan at any size, and further ones like it do not help"));
  return absl::InvalidArgumentError(
      absl::StrCat("'", effect, "' is no effect that this model lacks and touches can show; one of ",
                   absl::StrJoin(names, ", "), " was expected"));
}

absl::StatusOr<std::vector<ProposedTouch>> Improve(const PlanCheck& check, const PlanQuestion& question,
                                                   const engine::StepwiseSearch& search,
                                                   const engine::Fit& given) {
  const selection::Workspace& workspace = *check.workspace;
  std::vector<engine::ExplanationsLeft::NamedModel> models;
  if (!question.find.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const engine::DetectableValue value, BestOf(check.values, question.find));
    models = {{question.find, value.with_effect}, {kAsItIs, workspace.input.model}};
  } else {
    TOUCHSTONE_RETURN_IF_ERROR(BestOf(check.values, question.between[1]).status());
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const std::vector<engine::DetectableValue> pair,
        engine::FindDetectable(search, given, static_cast<int>(workspace.input.model->effects.size()),
                               check.sigma_s, {question.between[0], question.between[1]}));
    TOUCHSTONE_ASSIGN_OR_RETURN(const engine::DetectableValue value, BestOf(pair, question.between[0]));
    models = {{question.between[0], value.with_effect}, {question.between[1], value.with_rival}};
  }
  return ProposeTouches(*workspace.searched, models, check.sigma_s, question.improve, workspace.input.seed,
                        workspace.context.pool);
}

}  // namespace

DiagnosisInput AsPlan(const DiagnosisInput& input) {
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  set->fingers = input.model->fingers;
  set->time_s.assign(static_cast<size_t>(set->size()) * set->fingers, 0.0);
  DiagnosisInput timed = input;
  timed.set = std::move(set);
  return timed;
}

absl::StatusOr<PlanCheck> CheckPlan(const DiagnosisInput& input, const PlanQuestion& question,
                                    const DiagnosisContext& context) {
  if (input.set == nullptr || input.images != nullptr || !input.set->has_poses)
    return absl::InvalidArgumentError(
        "a check takes a plan of touches with poses; of photographs and of sets without poses it knows "
        "nothing");
  TOUCHSTONE_RETURN_IF_ERROR(CheckQuestion(question));
  PlanCheck check;
  TOUCHSTONE_ASSIGN_OR_RETURN(check.workspace, selection::MakeWorkspace(AsPlan(input), context));
  selection::Workspace& workspace = *check.workspace;
  workspace.observations->time_s = workspace.nominal.time_s;
  check.sigma_s = question.sigma_s;
  if (!(check.sigma_s > 0)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(check.sigma_s, NoiseOf(workspace));
  }
  TOUCHSTONE_RETURN_IF_ERROR(selection::PrepareSearch(&workspace, {}));
  bool cancelled = false;
  const auto progress = [&](const std::string& stage, double done) {
    cancelled |= context.progress && !context.progress(stage, done);
  };
  workspace.experiment.cancelled = [&] { return cancelled; };
  progress("checking", 0.1);
  const engine::StepwiseSearch search(workspace.experiment,
                                      selection::MakeCandidates(workspace.input, *workspace.searched),
                                      engine::SearchRules(), [](const std::string&) {});
  TOUCHSTONE_ASSIGN_OR_RETURN(
      const engine::Fit given,
      engine::FitModel(workspace.experiment,
                       engine::Parameterization(*workspace.input.model, workspace.searched->objects), 0));
  TOUCHSTONE_ASSIGN_OR_RETURN(
      check.values,
      engine::FindDetectable(search, given, static_cast<int>(workspace.input.model->effects.size()),
                             check.sigma_s));
  if (question.improve > 0) {
    progress("proposing", 0.7);
    TOUCHSTONE_ASSIGN_OR_RETURN(check.proposed, Improve(check, question, search, given));
  }
  return check;
}

}  // namespace touchstone::diagnosis::design
