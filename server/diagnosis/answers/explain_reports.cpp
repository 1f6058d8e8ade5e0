#include "server/diagnosis/answers/explain_reports.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <absl/strings/strip.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/text/readable_time.h"
#include "server/base/units.h"
#include "server/diagnosis/answers/early_verdicts.h"
#include "server/diagnosis/answers/how_wrong.h"
#include "server/diagnosis/answers/rules.h"
#include "server/diagnosis/report/kinds/from_touches.h"
#include "server/diagnosis/report/words/summary.h"
#include "server/diagnosis/selection/candidates.h"
#include "server/diagnosis/selection/quality.h"
#include "server/diagnosis/selection/touch_modality.h"

namespace touchstone::diagnosis {
namespace {

std::string ValuesInWords(const std::vector<engine::ParameterEstimate>& values) {
  std::vector<std::string> words;
  for (const engine::ParameterEstimate& value : values) words.push_back(report::ValueInWords(value));
  return absl::StrJoin(words, ", ");
}

// ", and exclude more than 0.02 mm (95 %)": of an effect of one value that ended at its bound.
std::string Excluded(const engine::EffectExplanation& found) {
  if (found.parameters.size() != 1) return "";
  const engine::ParameterEstimate& value = found.parameters[0];
  const double limit = value.upper > value.value ? value.upper : value.lower;
  if (limit == value.value) return "";
  return absl::StrFormat(", and exclude %s beyond %.2g%s (95 %%)", value.name, limit,
                         value.unit.empty() ? "" : " " + value.unit);
}

// The other effect that would gain most of those that do a part of the same.
const engine::TakenOver* StrongestRival(const engine::EffectExplanation& found) {
  const auto rival = std::max_element(
      found.taken_over.begin(), found.taken_over.end(),
      [](const engine::TakenOver& a, const engine::TakenOver& b) { return a.gain_nats < b.gain_nats; });
  return rival == found.taken_over.end() ? nullptr : &*rival;
}

std::string NameInWords(const std::string& effect) {
  const absl::string_view name = absl::StripPrefix(effect, engine::kGivenPrefix);
  return absl::StrCat(name, name.size() < effect.size() ? " of the model" : "");
}

std::string Words(const report::ReportedExplanation& explained, double rmse_us) {
  const engine::EffectExplanation& found = explained.found;
  const std::string& name = found.effect;
  if (!found.visible)
    return absl::StrCat("These touches do not depend on ", name, " at any size: they say nothing about it.");
  if (!found.changes)
    return absl::StrCat(name, " is not what is missing: the touches fit best where it changes nothing",
                        Excluded(found), ".");
  const std::string best = absl::StrCat("At its best (", ValuesInWords(found.parameters), ") ", name);
  const std::string error =
      absl::StrCat("the RMSE goes from ", TimeInWords(kSecondsPerMicrosecond * rmse_us), " to ",
                   TimeInWords(kSecondsPerMicrosecond * explained.quality.rmse));
  if (found.gain_nats < found.needed_nats)
    return absl::StrFormat(
        "%s changes the log evidence by %+.1f nats, and a search asks for %+.1f: these touches do not ask "
        "for it. Sizes "
        "outside of its 95 %% interval are excluded.",
        best, found.gain_nats, found.needed_nats);
  std::string words = absl::StrFormat("%s gains %.0f nats: %s.", best, found.gain_nats, error);
  const engine::TakenOver* rival = StrongestRival(found);
  if (rival == nullptr) return words + " No other effect does a part of the same.";
  const std::string other = NameInWords(rival->effect);
  const double equivalent_nats = engine::SearchRules().equivalent_nats;
  if (rival->gain_nats > found.gain_nats + equivalent_nats)
    return absl::StrCat(
        words, absl::StrFormat(" %s alone gains %.0f nats, and does %.0f %% of what %s does: it explains "
                               "these touches better.",
                               other, rival->gain_nats, 100 * rival->share, name));
  if (rival->gain_nats > found.gain_nats - equivalent_nats)
    return absl::StrCat(words, " ", other,
                        " explains them as well: ", engine::DiscriminatingMeasurement({name, rival->effect}));
  return absl::StrCat(words, absl::StrFormat(" The best of what resembles it, %s, gains %.0f nats.", other,
                                             rival->gain_nats));
}

// The effect fitted to the touches; where the better model says that a finger all but misses an edge, without those.
absl::StatusOr<engine::EffectExplanation> Find(const std::string& effect, selection::Workspace* workspace) {
  const model::Model& model = *workspace->input.model;
  engine::EffectExplanation found;
  for (int pass = 0; pass < 2; ++pass) {
    TOUCHSTONE_RETURN_IF_ERROR(selection::PrepareSearch(workspace, {}));
    const engine::StepwiseSearch search(workspace->experiment,
                                        selection::MakeCandidates(workspace->input, *workspace->searched),
                                        engine::SearchRules(), [](const std::string&) {});
    TOUCHSTONE_ASSIGN_OR_RETURN(
        const engine::Fit initial,
        engine::FitModel(workspace->experiment,
                         engine::Parameterization(model, workspace->searched->objects)));
    TOUCHSTONE_ASSIGN_OR_RETURN(
        found, engine::ExplainEffect(search, initial, static_cast<int>(model.effects.size()), effect));
    if (!found.fit) break;
    TOUCHSTONE_ASSIGN_OR_RETURN(const int edges,
                                selection::LeaveOutEdges(*workspace->predictor, found.fit->model.base(),
                                                         workspace->observations.get()));
    if (edges == 0) break;
  }
  return found;
}

}  // namespace

absl::StatusOr<report::Diagnosis> ExplainTouches(const DiagnosisInput& given, const std::string& effect,
                                                 const DiagnosisContext& context) {
  if (given.set == nullptr || given.images != nullptr || !given.set->has_poses)
    return absl::InvalidArgumentError(
        "an effect is explained on touches with poses; photographs and sets without poses were given");
  DiagnosisInput input = given;
  input.model = std::make_shared<const model::Model>(selection::TouchPartOf(*given.model));
  auto made = selection::MakeWorkspace(input, context);
  if (!made.ok()) return WithFix(made.status(), input, context);
  const std::unique_ptr<selection::Workspace> workspace = *std::move(made);
  const touches::Observations& o = *workspace->observations;
  report::Diagnosis diagnosis = BeginDiagnosis(*workspace);
  diagnosis.model_name = given.model->name;
  diagnosis.model_hash = given.model->Hash();
  const std::vector<double> before = touches::Residuals(o, workspace->nominal);
  AddHowWrong(*workspace, before, &diagnosis);
  if (!diagnosis.data[0].initial)
    return absl::InvalidArgumentError(
        absl::StrCat(input.set->origin, ": no touch can be compared with the model"));
  if (const int needed = TouchesNeeded(o); needed > 0) {
    diagnosis.verdict = engine::Verdict::kTooLittleData;
    diagnosis.data[0].needed = needed;
    diagnosis.warnings.push_back(report::Summarize(diagnosis));
  }
  report::ReportedExplanation& explained = diagnosis.explained.emplace();
  TOUCHSTONE_ASSIGN_OR_RETURN(explained.found, Find(effect, workspace.get()));
  if (explained.found.fit) {
    const engine::Fit& fit = *explained.found.fit;
    const model::Model& with = fit.model.base();
    TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction prediction,
                                workspace->predictor->Run(with, true, false));
    TOUCHSTONE_ASSIGN_OR_RETURN(const engine::Quality quality,
                                selection::QualityOfModel(*workspace, fit, with));
    explained.quality = report::InMicroseconds(quality);
    const std::vector<double> after = touches::Residuals(o, prediction);
    const double sigma_s = std::max(diagnosis.data[0].noise_floor->sigma * kSecondsPerMicrosecond, 1e-12);
    explained.speak_for =
        residuals::FindDecidingTouches(o, before, after, sigma_s, kAnswerRules.max_deciding, false);
    explained.speak_against =
        residuals::FindDecidingTouches(o, before, after, sigma_s, kAnswerRules.max_deciding, true);
  }
  explained.words = Words(explained, diagnosis.data[0].initial->rmse);
  if (diagnosis.verdict == engine::Verdict::kTooLittleData)
    explained.words = absl::StrCat("That is too little for a verdict. ", explained.words);
  diagnosis.summary = explained.words;
  return diagnosis;
}

absl::StatusOr<report::Versus> CompareWithOther(const selection::Workspace& workspace,
                                                const report::DataReport& data) {
  const model::Model& given = *workspace.input.other_model;
  if (given.fingers != workspace.input.model->fingers)
    return absl::InvalidArgumentError(absl::StrCat("the model '", given.name, "' has ", given.fingers,
                                                   " fingers, the model '", workspace.input.model->name,
                                                   "' has ", workspace.input.model->fingers));
  const model::Model model = selection::TouchPartOf(given);
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction other, workspace.predictor->Run(model, true, true));
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Observations alone,
                              selection::UsableUnder(workspace, model, other, workspace.comparable));
  // Both models on the touches that both of them meet.
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Observations o,
                              selection::UsableUnder(workspace, model, other, workspace.observations->used));
  report::Versus versus;
  versus.other_name = given.name;
  versus.other_hash = given.Hash();
  versus.other =
      report::InMicroseconds(selection::QualityAsCompared(alone, touches::Residuals(alone, other)));
  const double sigma_s = data.noise_floor ? data.noise_floor->sigma * kSecondsPerMicrosecond : 0;
  versus.difference =
      residuals::CompareModels(o, workspace.nominal, other, std::max(sigma_s, 1e-12), workspace.input.seed);
  const residuals::ModelDifference& d = versus.difference;
  const std::string interval =
      absl::StrCat("by ", TimeInWords(std::abs(d.difference_s)),
                   " (95 %: ", TimeInWords(std::min(std::abs(d.lower_s), std::abs(d.upper_s))), " to ",
                   TimeInWords(std::max(std::abs(d.lower_s), std::abs(d.upper_s))), ")");
  const bool less = d.upper_s<0, more = d.lower_s> 0;
  if (d.lower_s == 0 && d.upper_s == 0)
    versus.words = "Both models expect the same of these touches.";
  else if (less || more)
    versus.words = absl::StrCat("'", less ? given.name : workspace.input.model->name, "' errs less than '",
                                less ? workspace.input.model->name : given.name, "', ", interval, ".");
  else
    versus.words = absl::StrFormat(
        "These touches do not say which model errs less: the RMSE of '%s' differs by %.3g us (95 %%: %.3g to "
        "%.3g).",
        given.name, Microseconds(d.difference_s), Microseconds(d.lower_s), Microseconds(d.upper_s));
  return versus;
}

}  // namespace touchstone::diagnosis
