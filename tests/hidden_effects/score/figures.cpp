#include "tests/hidden_effects/score/figures.h"

#include <algorithm>
#include <cmath>

namespace touchstone::hidden {
namespace {

using Strings = std::vector<std::string>;

constexpr double kConfident = 0.9, kNearlyCertain = 0.99, kShownAsOne = 0.9995;
constexpr double kFall = 0.95, kFoundWithin = 0.05, kFreshWithin = 0.1;

bool IsIn(const Strings& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

bool BeginsWithAny(const std::string& name, const Strings& beginnings) {
  return std::any_of(beginnings.begin(), beginnings.end(), [&](const auto& beginning) {
    return name.compare(0, beginning.size(), beginning) == 0;
  });
}

bool Answered(const std::vector<Mark>& marks, const std::string& measure) {
  return std::any_of(marks.begin(), marks.end(),
                     [&](const Mark& mark) { return mark.measure == measure && mark.yes; });
}

// A surface that was measured is a bad print, whatever it is called; curves and formulas name nothing.
std::string Plain(const std::string& effect) {
  return effect == "surface_map" ? "surface_error" : effect;
}
bool IsNameless(const std::string& effect) {
  return BeginsWithAny(effect, {"lookup", "formula"});
}

// Whether a step, with what it says it may be instead, holds a true name.
bool HoldsTruth(const v1::Step& step, const Answer& answer) {
  if (IsNameless(step.effect()) || IsIn(answer.names, Plain(step.effect()))) return true;
  return std::any_of(step.equivalent().begin(), step.equivalent().end(),
                     [&](const auto& name) { return IsIn(answer.names, Plain(name)); });
}

// Whether the step says where it acts, or in which rounds.
bool SaysWhere(const v1::Step& step, const Strings& words) {
  const auto said = [&](const std::string& text) {
    return std::any_of(words.begin(), words.end(),
                       [&](const auto& word) { return text.find(word) != std::string::npos; });
  };
  bool where = said(step.words());
  for (const v1::ParameterValue& parameter : step.parameters()) where |= said(parameter.object());
  return where;
}

bool IsUnexplainedBy(const v1::Report& report, const Strings& covariates) {
  const auto& found = TouchEntry(report).unexplained().covariates();
  return report.verdict() == v1::Report::UNEXPLAINED && !found.empty() &&
         BeginsWithAny(found[0].name(), covariates);
}

bool OnlyTrueSteps(const v1::Report& report, const Answer& answer) {
  return std::all_of(report.steps().begin(), report.steps().end(),
                     [&](const v1::Step& step) { return HoldsTruth(step, answer); });
}

bool CauseIsRight(const Scenario& truth, const v1::Report& report, const Answer& answer) {
  if (IsUnexplainedBy(report, answer.covariates)) return true;
  const Cause& cause = truth.causes.front();
  // No covariate tells poses apart, so none may be named.
  if (cause.kind == CauseKind::kPoseError && report.verdict() == v1::Report::UNEXPLAINED &&
      TouchEntry(report).unexplained().covariates().empty())
    return OnlyTrueSteps(report, answer);
  Strings where;
  switch (cause.kind) {
    case CauseKind::kSlipOnOneObject:
    case CauseKind::kPushOnOneObject:
      where = {truth.objects.at(static_cast<size_t>(cause.at[0]))->name()};
      break;
    case CauseKind::kSlipInOneRound:
    case CauseKind::kPushInOneRound:
    case CauseKind::kRemounted:
      where = {"round", "anew"};
      break;
    default:
      break;
  }
  return report.steps_size() > 0 && OnlyTrueSteps(report, answer) &&
         std::any_of(report.steps().begin(), report.steps().end(), [&](const v1::Step& step) {
           return !IsNameless(step.effect()) && (where.empty() || SaysWhere(step, where));
         });
}

// Every value of the step within 3 standard errors or 5 % of the truth.
bool ValuesAreNear(const google::protobuf::RepeatedPtrField<v1::ParameterValue>& parameters,
                   const std::vector<double>& truth) {
  if (parameters.size() != static_cast<int>(truth.size())) return false;
  for (int i = 0; i < parameters.size(); ++i)
    if (std::abs(parameters[i].value() - truth[i]) >
        std::max(3 * parameters[i].std_error(), 0.05 * std::abs(truth[i])))
      return false;
  return true;
}

bool BeyondBoundIsRight(const Scenario& truth, const v1::Report& report) {
  if (report.steps_size() != 1 || report.verdict() != v1::Report::MISSING_EFFECTS) return false;
  const v1::Step& step = report.steps(0);
  const Hidden& hidden = truth.hidden.front();
  if (step.effect() == hidden.effect) return ValuesAreNear(step.parameters(), hidden.values);
  return std::find(step.equivalent().begin(), step.equivalent().end(), hidden.effect) !=
         step.equivalent().end();
}

bool OldValueIsRight(const Scenario& truth, const v1::Report& report) {
  const Hidden& hidden = truth.hidden.front();
  for (const v1::Refit& refit : report.refitted())
    if (refit.effect() == hidden.effect && report.verdict() == v1::Report::WRONG_VALUES)
      return ValuesAreNear(refit.parameters(), hidden.values);
  return report.steps_size() == 1 &&
         std::find(report.steps(0).equivalent().begin(), report.steps(0).equivalent().end(),
                   "given:" + hidden.effect) != report.steps(0).equivalent().end();
}

bool WrongNoiseIsRight(const Scenario& truth, const v1::Report& report) {
  const std::string& effect = truth.in_model.front().effect;
  bool said = std::find(report.superfluous().begin(), report.superfluous().end(), effect) !=
              report.superfluous().end();
  for (const v1::Refit& refit : report.refitted()) said |= refit.effect() == effect;
  return said && report.steps_size() == 0 && report.verdict() != v1::Report::UNEXPLAINED;
}

// Of a set that hides nothing.
bool IsQuiet(const v1::Report& report, const std::vector<Mark>& marks) {
  return !Answered(marks, "false claim") && report.verdict() != v1::Report::CHECK_DATA &&
         report.verdict() != v1::Report::TOO_LITTLE_DATA;
}

bool IsRight(const Arm& arm, const Scenario& truth, const v1::Report& report, const std::vector<Mark>& marks,
             const Answer& answer) {
  switch (arm.kind) {
    case Kind::kNothing:
      return IsQuiet(report, marks);
    case Kind::kEffects:
      return truth.hidden.empty() ? IsQuiet(report, marks) : Answered(marks, "all found, none added");
    case Kind::kIndistinguishable:
      return Answered(marks, "said so, with what decides");
    case Kind::kUnlisted:
      return Answered(marks, "unexplained") && Answered(marks, "right covariate first");
    case Kind::kNoPoses:
      return !Answered(marks, "names a culprit") && !Answered(marks, "false detection") &&
             (truth.hidden.empty() || Answered(marks, "detects"));
    case Kind::kWrongValue:
      return Answered(marks, "value right");
    case Kind::kNoiseMissing:
      return Answered(marks, "noise named") && Answered(marks, "noise within 5 %");
    case Kind::kCause:
      return CauseIsRight(truth, report, answer);
    case Kind::kBeyondBound:
      return BeyondBoundIsRight(truth, report);
    case Kind::kBadPrint:
      return OnlyTrueSteps(report, answer) &&
             (report.steps_size() > 0 || report.verdict() == v1::Report::UNEXPLAINED);
    case Kind::kOldValue:
      return OldValueIsRight(truth, report);
    case Kind::kWrongNoise:
      return WrongNoiseIsRight(truth, report);
    case Kind::kDataError:
      return report.verdict() == v1::Report::CHECK_DATA && report.data_problems_size() > 0 &&
             IsIn(answer.problems, KindOf(report.data_problems(0)));
    case Kind::kTooFew:
      return report.verdict() == v1::Report::TOO_LITTLE_DATA;
  }
  return false;
}

bool NothingToFind(const Arm& arm, const Scenario& truth) {
  return truth.hidden.empty() && truth.unlisted.empty() && truth.causes.empty() &&
         truth.data_errors.empty() &&
         (arm.kind == Kind::kNothing || arm.kind == Kind::kEffects || arm.kind == Kind::kNoPoses);
}

bool SaysNothingIsMissing(const v1::Report& report) {
  return report.verdict() == v1::Report::ADEQUATE || report.verdict() == v1::Report::WRONG_VALUES;
}

bool IsConfidentlyWrong(const Arm& arm, const Scenario& truth, const v1::Report& report, const Answer& answer,
                        bool right, double final_found_us) {
  for (const v1::Step& step : report.steps())
    if (step.probability() > kConfident && !HoldsTruth(step, answer)) return true;
  const auto verdict = report.verdict();
  if (verdict == v1::Report::CHECK_DATA &&
      (report.data_problems_size() == 0 || !IsIn(answer.problems, KindOf(report.data_problems(0)))))
    return true;
  if (FallIsNotFound(report, final_found_us)) return true;
  if (right) return false;
  if (NothingToFind(arm, truth)) return verdict == v1::Report::WRONG_VALUES;
  return arm.strength == Strength::kStrong && SaysNothingIsMissing(report);
}

// Of a report that is neither right nor confidently wrong: it says that it does not know, or its steps hold the truth
// or are unsure of themselves, or what it misses is weak.
bool DoesNotMislead(const Arm& arm, const Scenario& truth, const v1::Report& report, const Answer& answer) {
  if (report.verdict() == v1::Report::TOO_LITTLE_DATA) return true;
  if (arm.kind == Kind::kNoPoses) return report.steps_size() == 0;
  const bool open_steps =
      report.steps_size() > 0 &&
      std::all_of(report.steps().begin(), report.steps().end(), [&](const v1::Step& step) {
        return step.probability() <= kConfident || HoldsTruth(step, answer);
      });
  if (open_steps) return true;
  if (NothingToFind(arm, truth)) return false;
  if (report.verdict() == v1::Report::UNEXPLAINED) return true;
  const bool weak = arm.strength == Strength::kWeak || arm.name == "one weak";
  return SaysNothingIsMissing(report) && weak;
}

}  // namespace

bool IsACurve(const Arm& arm, const Scenario& truth) {
  if (arm.kind == Kind::kUnlisted) return true;
  return std::any_of(truth.causes.begin(), truth.causes.end(), [](const Cause& cause) {
    return cause.kind == CauseKind::kSessionWave || cause.kind == CauseKind::kWarmUp ||
           cause.kind == CauseKind::kMidSession || cause.kind == CauseKind::kIncidenceWave;
  });
}

bool ClaimsAFall(const v1::Report& report) {
  return TouchEntry(report).has_final() &&
         TouchEntry(report).final().rmse() < kFall * TouchEntry(report).initial().rmse();
}

double ClaimedErrorUs(const v1::Report& report) {
  const v1::Quality& final = TouchEntry(report).final();
  return final.heldout_rmse() > 0 ? final.heldout_rmse() : final.rmse();
}

bool FallIsNotFound(const v1::Report& report, double final_found_us) {
  return ClaimsAFall(report) &&
         !(std::abs(final_found_us / TouchEntry(report).final().rmse() - 1) <= kFoundWithin);
}

std::vector<Mark> JudgeFigures(const Arm& arm, const Scenario& truth, const v1::Report& report,
                               const std::vector<Mark>& marks, const Tried& tried) {
  const Answer answer = AnswerFor(arm, truth);
  std::vector<Mark> out;
  const bool right_words = IsRight(arm, truth, report, marks, answer);
  const bool wrong = IsConfidentlyWrong(arm, truth, report, answer, right_words, tried.final_found_us);
  const bool right = right_words && !wrong;
  out.push_back({"right", right});
  out.push_back({"honest", right || (!wrong && DoesNotMislead(arm, truth, report, answer))});
  out.push_back({"confidently wrong", wrong});
  for (const v1::Step& step : report.steps()) {
    out.push_back({"probability of 1", step.probability() >= kShownAsOne});
    if (step.probability() > kNearlyCertain && !IsNameless(step.effect()))
      out.push_back({"claim beyond 0.99 right", HoldsTruth(step, answer)});
  }
  if (ClaimsAFall(report)) {
    out.push_back({"fall not found again", FallIsNotFound(report, tried.final_found_us)});
    out.push_back({"error on fresh touches as claimed",
                   std::abs(tried.fresh_us / ClaimedErrorUs(report) - 1) <= kFreshWithin});
  }
  if (arm.depends_on_time)
    out.push_back({"unexplained by time", right && report.verdict() == v1::Report::UNEXPLAINED});
  if (IsACurve(arm, truth)) out.push_back({"lookup halves the misfit", tried.lookup_cuts_to <= 0.5});
  return out;
}

}  // namespace touchstone::hidden
