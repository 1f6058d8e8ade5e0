#include "server/diagnosis/touch_reports.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <set>

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/answers/early_verdicts.h"
#include "server/diagnosis/answers/explain_reports.h"
#include "server/diagnosis/answers/how_wrong.h"
#include "server/diagnosis/answers/uncertainty_reports.h"
#include "server/diagnosis/checks/data_problems.h"
#include "server/diagnosis/checks/rows/round_speed.h"
#include "server/diagnosis/design/propose.h"
#include "server/diagnosis/distributions/pose_free.h"
#include "server/diagnosis/progress_gate.h"
#include "server/diagnosis/report/kinds/from_distributions.h"
#include "server/diagnosis/report/kinds/from_touches.h"
#include "server/diagnosis/report/words/summary.h"
#include "server/diagnosis/residuals/touches/describe_residuals.h"
#include "server/diagnosis/rules.h"
#include "server/diagnosis/selection/ladder/ladder.h"
#include "server/diagnosis/selection/quality.h"
#include "server/diagnosis/selection/touch_modality.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis {
namespace {

constexpr char kCancelled[] = "the diagnosis was cancelled";

double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// The model's effects of photographs are no business of touches: a diagnosis works without them, and they come back
// as they were into every model that it gives.
struct PhotographEffects {
  explicit PhotographEffects(const DiagnosisInput& input)
      : touches(input), given(input.model), effects(selection::PhotographEffectsOf(*input.model)) {
    if (!effects.empty())
      touches.model = std::make_shared<const model::Model>(selection::TouchPartOf(*input.model));
  }
  void PutBack(report::Diagnosis* diagnosis) const {
    const auto put_back = [this](model::Model* model) {
      model->effects.insert(model->effects.end(), effects.begin(), effects.end());
    };
    if (diagnosis->improved_model) put_back(&*diagnosis->improved_model);
    for (report::DataReport& data : diagnosis->data)
      if (data.unexplained && data.unexplained->model_with) put_back(&*data.unexplained->model_with);
    for (report::Step& step : diagnosis->steps)
      if (!step.model.effects.empty()) put_back(&step.model);
    if (!diagnosis->posterior) return;
    if (diagnosis->improved_model) {
      put_back(&diagnosis->posterior->model);
      return;
    }
    // The given model, whose effects of photographs may stand anywhere.
    std::vector<int> places;
    for (size_t i = 0; i < given->effects.size(); ++i)
      if (!given->effects[i].effect->of_photos()) places.push_back(static_cast<int>(i));
    for (uncertainty::OpenValue& value : diagnosis->posterior->values) value.effect = places[value.effect];
    diagnosis->posterior->model = *given;
  }
  void NameGiven(report::Diagnosis* diagnosis) const {
    diagnosis->model_name = given->name;
    diagnosis->model_hash = given->Hash();
  }

  DiagnosisInput touches;  // the input without them
  std::shared_ptr<const model::Model> given;
  std::vector<model::EffectInstance> effects;
};

// The residuals of the initial and of the improved model, described.
residuals::ResidualSummary DescribeBoth(const selection::Workspace& workspace,
                                        const touches::Prediction& initial, const std::vector<double>& before,
                                        const touches::Prediction& improved, const std::vector<double>& after,
                                        double sigma_s) {
  return residuals::DescribeResiduals(*workspace.observations, initial, improved, before, after,
                                      {sigma_s, workspace.input.model->spacing_m, workspace.input.seed});
}

void AddSentences(report::Diagnosis* diagnosis) {
  for (std::string& warning : report::DataWarnings(diagnosis->data[0]))
    diagnosis->warnings.push_back(std::move(warning));
  diagnosis->summary = report::Summarize(*diagnosis);
}

// Touches that would tell what fits equally well apart. Always asked for by Propose; Diagnose asks only where
// something is confounded.
absl::Status AddNextTouches(const selection::Workspace& workspace,
                            const selection::SelectionResult& selection, const selection::Ladder& ladder,
                            int max_touches, bool always, report::Diagnosis* diagnosis) {
  const engine::ExplanationsLeft left =
      engine::FindExplanationsLeft(selection.fit, selection.steps, ladder.improved);
  if (!left.confounded && !always) return absl::OkStatus();
  const auto propose = [&](const std::vector<engine::ExplanationsLeft::NamedModel>& models) {
    return design::ProposeTouches(*workspace.searched, models, ladder.noise_floor.sigma, max_touches,
                                  workspace.input.seed, workspace.context.pool);
  };
  TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<design::ProposedTouch> touches, propose(left.models));
  const bool none = touches.empty();
  // What no touch tells apart has values nevertheless.
  if (always && none && left.models.size() > 1) {
    TOUCHSTONE_ASSIGN_OR_RETURN(touches, propose({left.models[0]}));
  }
  diagnosis->next.assign(touches.begin(), touches.end());
  if (!always || !none) return absl::OkStatus();
  diagnosis->warnings.push_back(
      left.models.size() < 2
          ? "No touch would tell more than those at hand."
          : absl::StrCat("No touch of this rig tells ", left.models[0].name, " from ", left.models[1].name,
                         ": ",
                         engine::DiscriminatingMeasurement({left.models[0].name, left.models[1].name})));
  return absl::OkStatus();
}

absl::StatusOr<report::Diagnosis> DiagnosePoseFree(const DiagnosisInput& input,
                                                   const DiagnosisContext& context, bool with_verdict) {
  TOUCHSTONE_ASSIGN_OR_RETURN(distributions::PoseFreeComparison comparison,
                              distributions::ComparePoseFree(input, context, with_verdict));
  return report::FromDistributions(input, std::move(comparison));
}

// Whether what differs in a part of the session may be the speed of the arm there.
bool SpeedSaysTheSame(const selection::GroupDifference& group) {
  constexpr char kSpeed[] = "speed_error";
  std::vector<std::string> names = group.also;
  names.push_back(group.effect);
  const auto is_named = [&names](const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  for (const auto& effect : effects::TouchEffects())
    if (effect->name == kSpeed)
      return is_named(kSpeed) || std::any_of(effect->confounded_with.begin(), effect->confounded_with.end(),
                                             [&](const auto& other) { return is_named(other.effect); });
  return false;
}

// Whether repeats agree better with one round at another speed than with what was found, which may be a change in time.
absl::StatusOr<bool> RoundSpeedSaysMore(const selection::Workspace& workspace,
                                        const selection::SelectionResult& selection) {
  const touches::Observations& o = *workspace.observations;
  const checks::RoundSpeed speed = checks::FindRoundSpeed(o);
  touches::Prediction fixed = workspace.nominal;
  const std::set<int> rows(speed.rows.begin(), speed.rows.end());
  for (int k = 0; k < o.size(); ++k)
    if (rows.count(o.row[k]) > 0)
      for (int i = 0; i < o.fingers; ++i)
        fixed.time_s[static_cast<size_t>(k) * o.fingers + i] /= speed.factor;
  TOUCHSTONE_ASSIGN_OR_RETURN(const touches::Prediction found,
                              workspace.predictor->Run(selection.fit.model.base(), false, false));
  const auto scatter = [&o](const touches::Prediction& prediction) {
    return selection::NoiseFloorOf(o, touches::Residuals(o, prediction), 0).sigma;
  };
  return scatter(fixed) <= scatter(found);
}

// `always`: Propose, which names touches even where nothing is confounded.
absl::StatusOr<report::Diagnosis> Diagnosed(const DiagnosisInput& input, int max_touches, bool always,
                                            const DiagnosisContext& context) {
  if (!input.set->has_poses) return DiagnosePoseFree(input, context, true);
  const double began = Now();
  ProgressGate gate(context);
  DiagnosisContext gated = context;
  gated.progress = [&gate](const std::string& stage, double done) { return gate.Enter(stage, done); };
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<engine::DataProblem> problems,
                              checks::FindDataProblems(input, gated));
  const auto check_data = [&](const std::vector<engine::DataProblem>& found) {
    report::Diagnosis diagnosis = CheckDataReport(input, gated, found);
    diagnosis.duration_s = Now() - began;
    return diagnosis;
  };
  if (!problems.empty()) return check_data(problems);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<selection::Workspace> workspace,
                              selection::MakeWorkspace(input, gated));
  workspace->experiment.cancelled = [&gate] { return !gate.Continue(); };
  if (!gate.Enter("fitting", 0.1)) return absl::CancelledError(kCancelled);
  const touches::Observations& o = *workspace->observations;
  const int touches_needed = TouchesNeeded(o);
  const bool none_used = std::none_of(o.used.begin(), o.used.end(), [](char used) { return used; });
  if (touches_needed > 0 && (!always || none_used)) {
    report::Diagnosis diagnosis = TooLittleDataReport(*workspace, touches_needed);
    diagnosis.duration_s = Now() - began;
    return diagnosis;
  }
  // As a comparison finds it: the search leaves out outliers.
  const double compared_s = touches::Rmse(o, touches::Residuals(o, workspace->nominal));
  const auto compared = std::count(o.used.begin(), o.used.end(), 1);
  TOUCHSTONE_ASSIGN_OR_RETURN(selection::SelectionResult selection,
                              selection::SelectExplanation(workspace.get()));
  if (!selection.group || SpeedSaysTheSame(*selection.group)) {
    const std::vector<engine::DataProblem> of_round = checks::FindRoundAtAnotherSpeed(input, context.pool);
    if (!of_round.empty()) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool says_more, RoundSpeedSaysMore(*workspace, selection));
      if (says_more) return check_data(of_round);
    }
  }
  if (!gate.Enter("describing", 0.7)) return absl::CancelledError(kCancelled);
  report::Diagnosis diagnosis = BeginDiagnosis(*workspace);
  diagnosis.data[0].set_aside.outliers =
      static_cast<int>(compared - std::count(o.used.begin(), o.used.end(), 1));
  const std::vector<double> before = touches::Residuals(o, workspace->nominal);
  TOUCHSTONE_ASSIGN_OR_RETURN(engine::Quality quality,
                              selection::QualityOf(*workspace, selection.initial_model, before));
  double assessed_s = quality.rmse;  // of the touches that are assessed
  selection::SetError(compared_s, &quality);
  diagnosis.data[0].initial = report::InMicroseconds(quality);
  TOUCHSTONE_ASSIGN_OR_RETURN(const selection::Ladder ladder, selection::BuildLadder(*workspace, &selection));
  if (ladder.set_aside.is_finding) {
    std::vector<int> rows;
    for (const int k : touches::LeftOutFor(o, touches::kOutlierReason)) rows.push_back(o.row[k]);
    const std::vector<engine::DataProblem> of_rows = checks::FindProblemsOfRows(input, rows, context.pool);
    if (!of_rows.empty()) return check_data(of_rows);
  }
  report::AddLadder(ladder, &diagnosis);
  report::DataReport& data = diagnosis.data[0];
  // Errors of the surface that the model expects are no misfit.
  if (ladder.surface_as_given) {
    const engine::Quality beside = selection::QualityWithoutSurface(*workspace, selection.initial_model);
    data.initial->lack_of_fit_p = beside.lack_of_fit_p;
    assessed_s = std::min(assessed_s, beside.rmse);
  }
  // An error and the floor below it are of the same touches.
  data.reducible_share = report::ReducibleShare(*data.noise_floor, assessed_s * kMicrosecondsPerSecond);
  engine::NothingMissing worst = engine::WorstOfAll(selection.tried);
  if (ladder.unexplained) worst = engine::WithRest(worst, *ladder.unexplained, ladder.set_aside.p);
  report::SetNothingMissing(worst, &diagnosis);
  if (!gate.Enter("describing", 0.85)) return absl::CancelledError(kCancelled);
  // A part of a joint diagnosis describes what the model had left before anything was put in place.
  touches::Prediction initial = workspace->nominal;
  if (input.initial_model != nullptr) {
    TOUCHSTONE_ASSIGN_OR_RETURN(initial, workspace->predictor->Run(*input.initial_model, true, true));
  }
  report::AddResiduals(DescribeBoth(*workspace, initial, touches::Residuals(o, initial), ladder.prediction,
                                    ladder.residuals, ladder.noise_floor.sigma),
                       &diagnosis.data[0]);
  TOUCHSTONE_RETURN_IF_ERROR(
      AddUncertainty(*workspace->predictor, ladder.prediction, ladder.posterior, &diagnosis));
  AddSentences(&diagnosis);
  TOUCHSTONE_ASSIGN_OR_RETURN(diagnosis.detectable,
                              engine::FindDetectable(*selection.search, selection.fit,
                                                     selection.initial_effects, selection.fit.sigma));
  TOUCHSTONE_RETURN_IF_ERROR(AddNextTouches(*workspace, selection, ladder, max_touches, always, &diagnosis));
  if (touches_needed > 0) {
    // So few touches say where to touch next, and no more.
    report::Diagnosis little = TooLittleDataReport(*workspace, touches_needed);
    little.next = std::move(diagnosis.next);
    little.warnings = std::move(diagnosis.warnings);
    diagnosis = std::move(little);
  }
  diagnosis.duration_s = Now() - began;
  gate.Enter("done", 1);
  return diagnosis;
}

absl::StatusOr<report::Diagnosis> WithPhotographEffects(const DiagnosisInput& input, int max_touches,
                                                        bool always, const DiagnosisContext& context) {
  const PhotographEffects photographs(input);
  TOUCHSTONE_ASSIGN_OR_RETURN(report::Diagnosis diagnosis,
                              Diagnosed(photographs.touches, max_touches, always, context));
  photographs.PutBack(&diagnosis);
  photographs.NameGiven(&diagnosis);
  return diagnosis;
}

}  // namespace

absl::StatusOr<report::Diagnosis> CompareTouches(const DiagnosisInput& given,
                                                 const DiagnosisContext& context) {
  const PhotographEffects photographs(given);
  const DiagnosisInput& input = photographs.touches;
  if (!input.set->has_poses) return DiagnosePoseFree(input, context, false);
  const double began = Now();
  ProgressGate gate(context);
  DiagnosisContext gated = context;
  gated.progress = [&gate](const std::string& stage, double done) { return gate.Enter(stage, done); };
  auto made = selection::MakeWorkspace(input, gated);
  if (!made.ok()) return WithFix(made.status(), input, gated);
  const std::unique_ptr<selection::Workspace> workspace = *std::move(made);
  if (!gate.Enter("comparing", 0.3)) return absl::CancelledError(kCancelled);
  const touches::Observations& o = *workspace->observations;
  report::Diagnosis diagnosis = BeginDiagnosis(*workspace);
  const std::vector<double> residuals = touches::Residuals(o, workspace->nominal);
  AddHowWrong(*workspace, residuals, &diagnosis);
  for (const model::EffectInstance& instance : input.model->effects)
    if (instance.effect->role == model::EffectRole::kSmoothError)
      diagnosis.warnings.push_back(
          absl::StrCat("The model expects surfaces to be wrong (", instance.effect->name,
                       "): that part of the error is expected, and no comparison takes it off."));
  report::DataReport& data = diagnosis.data[0];
  if (data.noise_floor)
    report::AddResiduals(DescribeBoth(*workspace, workspace->nominal, residuals, workspace->nominal,
                                      residuals, data.noise_floor->sigma * kSecondsPerMicrosecond),
                         &data);
  photographs.NameGiven(&diagnosis);
  AddSentences(&diagnosis);
  if (input.other_model != nullptr && data.initial) {
    TOUCHSTONE_ASSIGN_OR_RETURN(data.versus, CompareWithOther(*workspace, data));
    diagnosis.summary = absl::StrCat(data.versus->words, " ", diagnosis.summary);
  }
  diagnosis.duration_s = Now() - began;
  return diagnosis;
}

absl::StatusOr<report::Diagnosis> DiagnoseTouches(const DiagnosisInput& input,
                                                  const DiagnosisContext& context) {
  return WithPhotographEffects(input, kDiagnosisRules.default_touches, false, context);
}

absl::StatusOr<report::Diagnosis> ProposeTouches(const DiagnosisInput& input, int max_touches,
                                                 const DiagnosisContext& context) {
  return WithPhotographEffects(input, max_touches, true, context);
}

}  // namespace touchstone::diagnosis
