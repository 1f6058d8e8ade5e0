// The verdict in one sentence.
#include <algorithm>
#include <map>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "client/report/words/error_scale.h"
#include "client/report/words/joint.h"

namespace touchstone::client {
namespace {

constexpr size_t kMaxOthersNamed = 3;  // that could be meant as well; more are counted
constexpr double kMinAsserted = 0.5;   // probability beyond which a step beside what has no name is asserted

bool IsAsserted(const v1::Step& step) {
  return step.probability() > kMinAsserted;
}

std::string Steps(const std::vector<v1::Step>& steps) {
  std::vector<std::string> names;
  for (const v1::Step& step : steps) {
    // "a (or b) and c": brackets keep the two apart.
    const std::vector<std::string> others(step.equivalent().begin(), step.equivalent().end());
    const bool counted = others.size() > kMaxOthersNamed;
    const bool alone = steps.size() == 1 || others.empty();
    const std::string rest = counted ? absl::StrCat(others.size(), " others") : Join(others, "or");
    names.push_back(!alone    ? absl::StrCat(step.effect(), " (or ", rest, ")")
                    : counted ? RungName(step)
                              : StepName(step));
  }
  return Join(names, "and");
}

std::string Steps(const v1::Report& report) {
  return Steps(std::vector<v1::Step>(report.steps().begin(), report.steps().end()));
}

std::string Falls(const ErrorScale& scale, double from, double to) {
  return absl::StrCat("the error falls from ", scale.Text(from), " to ", scale.Text(to));
}

// Of several sessions the errors are those of the one whose model is saved.
std::string InSession(const v1::Report& report) {
  if (!report.has_sessions()) return "";
  const v1::DataReport& main = MainData(report);
  for (int s = 0; s < report.data_size(); ++s)
    if (&report.data(s) == &main) return absl::StrCat(" in ", SessionLabel(report, s));
  return "";
}

// "960 touches"; of a joint report "93 touches and 12 pictures".
std::string Readings(const v1::Report& report) {
  std::vector<std::string> counts;
  for (const v1::DataReport& data : report.data())
    if (IsJoint(report) || &data == &MainData(report))
      counts.push_back(absl::StrCat(Count(data.count()), " ", ErrorScale(data).readings()));
  return Join(counts, "and");
}

// A step that says nothing of single touches (a surface error) leaves the error where it was.
bool FallsAtAll(const ErrorScale& scale, double from, double to) {
  return scale.Text(from) != scale.Text(to) && to < from;
}

// What repeats show comes before what distributions hide.
std::string FoundInRepeats(const v1::DistributionComparison& comparison) {
  static const std::map<v1::RepeatFinding::Kind, const char*> kKinds = {
      {v1::RepeatFinding::SESSION, "repeats change with their place in the session"},
      {v1::RepeatFinding::PREVIOUS_PRESS, "repeats depend on the previous touch"},
      {v1::RepeatFinding::TAILS, "repeats scatter with tails"},
      {v1::RepeatFinding::TICKS, "all times sit on ticks"}};
  std::vector<std::string> found;
  for (const v1::RepeatFinding& finding : comparison.findings()) {
    const auto kind = kKinds.find(finding.kind());
    found.push_back(absl::StrCat(kind == kKinds.end() ? finding.words() : kind->second, " (p ",
                                 Probability(finding.p()), ")"));
  }
  return absl::StrCat("The model lacks something that shows without poses: ", Join(found, "and"), ".");
}

// "The model is off by 11.1 ms on touches (4.0 times the noise floor) and 6.03 grey on pictures (4.2 times the noise floor)."
std::string ComparedByKind(const v1::Report& report) {
  std::vector<std::string> errors;
  for (const v1::DataReport& data : report.data()) {
    const ErrorScale scale(data);
    const double floor = NoiseFloorOf(data).sigma, rmse = data.initial().rmse();
    errors.push_back(absl::StrCat(
        scale.Text(rmse), " on ", scale.readings(),
        floor > 0 ? absl::StrCat(" (", Number(rmse / floor, 2), " times the noise floor)") : ""));
  }
  return absl::StrCat("The model is off by ", Join(errors, "and"), ".");
}

std::string Compared(const v1::Report& report) {
  const v1::DataReport& data = MainData(report);
  if (data.has_distributions()) {
    // Of all measures together, where the report has it.
    const double p = data.has_initial() ? data.initial().lack_of_fit_p() : data.distributions().p();
    if (!data.distributions().findings().empty()) return FoundInRepeats(data.distributions());
    const std::string lacks =
        report.steps().empty() ? "M" : absl::StrCat("The model lacks ", Steps(report), "; with it, m");
    return absl::StrCat(lacks, "easured and simulated touches ",
                        p < 0.01 ? "differ as distributions" : "cannot be told apart as distributions",
                        " (p ", p < 1e-15 ? "" : "= ", Probability(p), ").");
  }
  if (IsJoint(report)) return ComparedByKind(report);
  const ErrorScale scale(data);
  const double rmse = data.initial().rmse();
  if (AgreesToRounding(data)) return "The model agrees with the data to the rounding of files and meshes.";
  if (!(rmse > 0)) return "Nothing could be compared.";
  const Floor floor = NoiseFloorOf(data);
  if (!(floor.sigma > 0))
    return absl::StrCat("The model is off by ", scale.Text(rmse), InSession(report), ".");
  return absl::StrCat("The model is off by ", scale.Text(rmse), ", ", Number(rmse / floor.sigma, 2),
                      " times the noise floor", InSession(report), ".");
}

std::string Unexplained(const v1::Report& report) {
  std::string on;
  bool between_rounds = false;
  for (const v1::DataReport& data : report.data()) {
    if (!on.empty() || data.unexplained().covariates().empty()) continue;
    const std::string& covariate = data.unexplained().covariates(0).name();
    on = absl::StrCat(" It depends on ", CovariateName(covariate), ".");
    between_rounds = covariate == "round";
  }
  std::vector<v1::Step> asserted, doubtful;
  for (const v1::Step& step : report.steps()) (IsAsserted(step) ? asserted : doubtful).push_back(step);
  const std::string instead =
      doubtful.empty() ? "." : absl::StrCat("; ", Steps(doubtful), " may stand in for a part of it.");
  // An effect of the catalogue may explain a part of the session.
  if (between_rounds)
    return absl::StrCat(asserted.empty() ? "" : absl::StrCat("The model lacks ", Steps(asserted), ". "),
                        "Something changed between the rounds of the session", instead);
  if (asserted.empty())
    return absl::StrCat("The model is wrong in a way that no built-in effect explains", instead, on);
  return absl::StrCat("The model lacks ", Steps(asserted),
                      ", and something more that no built-in effect explains", instead, on);
}

std::string CheckData(const v1::Report& report) {
  if (report.data_problems().empty()) return "Check the data: the file has a mistake.";
  const v1::DataProblem& problem = report.data_problems(0);
  const std::string what = absl::StrCat("Check the data before the model: ", ProblemTitle(problem));
  const ErrorScale scale(DataOf(report, problem));
  const double before = problem.error_before(), after = problem.error_after();
  if (!(after > 0) || !(after < before)) return absl::StrCat(what, ".");
  return absl::StrCat(what, "; fixed, ", Falls(scale, before, after), ".");
}

std::string TooLittle(const v1::Report& report) {
  const v1::DataReport& data = MainData(report);
  const ErrorScale scale(data);
  const uint32_t used = data.count();
  // A picture that is taken again shows noise and nothing else: photographs are counted by pose.
  std::string needed = absl::StrCat(Count(data.needed()), " usable touches would do.");
  if (scale.pictures())
    needed = absl::StrCat("usable pictures from ", Count(data.needed()), " poses would do.");
  if (report.data_size() > 1) needed = "the summary says which kind needs more.";
  if (used == 0)
    return absl::StrCat("No ", scale.one_reading(), " could be used, so nothing can be said; ", needed);
  return absl::StrCat("Too little data for a verdict: ", Count(used), " ", scale.Counted(used), "; ", needed);
}

std::string WrongValues(const v1::Report& report) {
  std::vector<std::string> names;
  // Noise is estimated anew whatever the verdict: it has its say where nothing else has.
  for (const v1::Refit& refit : report.refitted())
    if (!absl::StrContains(refit.effect(), "noise")) names.push_back(refit.effect());
  const std::vector<std::string> superfluous(report.superfluous().begin(), report.superfluous().end());
  std::string what = "No effect is missing";
  if (!names.empty()) absl::StrAppend(&what, ", but the values of ", Join(names, "and"), " are off");
  if (!superfluous.empty())
    absl::StrAppend(&what, names.empty() ? ", but " : ", and ", "the data do without ",
                    Join(superfluous, "and"));
  if (names.empty() && superfluous.empty()) what += ", but the noise is not what the model says";
  const v1::DataReport& data = MainData(report);
  const ErrorScale scale(data);
  const double from = data.initial().rmse(), to = data.final().rmse();
  if (IsJoint(report) && !FallsOfBoth(report).empty())
    return absl::StrCat(what, ": put right, the error ", FallsOfBoth(report), ".");
  return absl::StrCat(
      what, FallsAtAll(scale, from, to) ? absl::StrCat(": put right, ", Falls(scale, from, to)) : "",
      InSession(report), ".");
}

std::string MissingEffects(const v1::Report& report) {
  const v1::DataReport& data = MainData(report);
  const ErrorScale scale(data);
  const double from = data.initial().rmse(), to = data.final().rmse();
  const std::string lacks = absl::StrCat("The model lacks ", Steps(report), "; ");
  // A map of the surface is made from these very touches: what it does for others is what it is worth.
  const bool maps = std::any_of(report.steps().begin(), report.steps().end(),
                                [](const v1::Step& step) { return step.effect() == "surface_map"; });
  if (maps) {
    const v1::DataReport& touches = report.data(0);
    const ErrorScale time(touches);
    const double given = touches.initial().rmse(), unseen = touches.final().heldout_rmse();
    return absl::StrCat(
        lacks, "on unseen touches the error ",
        FallsAtAll(time, given, unseen) ? absl::StrCat("falls from ", time.Text(given), " to ") : "stays ",
        time.Text(unseen), ".");
  }
  if (IsJoint(report) && !FallsOfBoth(report).empty())
    return absl::StrCat(lacks, "with ", report.steps_size() > 1 ? "them " : "it ", "the error ",
                        FallsOfBoth(report), ".");
  if (!FallsAtAll(scale, from, to)) return absl::StrCat(lacks, "the error stays ", scale.Text(to), ".");
  const Floor floor = NoiseFloorOf(data);
  const bool reached = floor.sigma > 0 && to <= 1.05 * floor.sigma;
  return absl::StrCat(lacks, "with ", report.steps_size() > 1 ? "them" : "it", InSession(report), " ",
                      Falls(scale, from, to), reached ? ", the noise floor." : ".");
}

// Of a report without P(nothing is missing); empty: a comparison, a plan, a report of a version that had none.
std::string WhyNotAssessed(const v1::Report& report) {
  switch (report.verdict()) {
    case v1::Report::VERDICT_UNSPECIFIED:
      return "";
    case v1::Report::CHECK_DATA:
      return "a mistake in the data comes first";
    case v1::Report::TOO_LITTLE_DATA:
      return "there is too little data";
    default:
      break;
  }
  if (MainData(report).has_distributions()) return "touches without poses are compared as distributions";
  for (const v1::DataReport& data : report.data())
    if (data.kind() == v1::DataReport::PHOTOGRAPHS)
      return report.data_size() > 1
                 ? "touches and photographs were diagnosed one by one, or the pictures are too few"
                 : "the pictures are too few";
  return "";
}

}  // namespace

bool AgreesToRounding(const v1::DataReport& data) {
  return data.noise().is_rounding() && data.initial().rmse() <= data.noise_floor();
}

std::string VerdictWord(const v1::Report& report) {
  return report.verdict() == v1::Report::VERDICT_UNSPECIFIED ? ""
                                                             : v1::Report::Verdict_Name(report.verdict());
}

std::string NothingMissingWords(const v1::Report& report) {
  if (!report.has_p_nothing_missing()) {
    const std::string why = WhyNotAssessed(report);
    return why.empty() ? "" : absl::StrCat("P(nothing is missing) is not assessed: ", why, ".");
  }
  const double p = report.p_nothing_missing();
  // What is found only where sessions or kinds of measurement are compared, say.
  constexpr double kSaysNothing = 0.05;
  const bool beside =
      (report.verdict() == v1::Report::UNEXPLAINED || report.verdict() == v1::Report::MISSING_EFFECTS) &&
      p > kSaysNothing;
  return absl::StrCat("P(nothing is missing) ", p < 1e-15 ? "" : "= ", Probability(p), " over ",
                      Count(report.hypotheses_tried()), " hypotheses",
                      beside ? ", of which none is what the verdict rests on." : ".");
}

std::string Headline(const v1::Report& report) {
  const std::string model =
      report.model_name().empty() ? "the model" : absl::StrCat("'", report.model_name(), "'");
  if (MainData(report).has_distributions()) return Compared(report);
  switch (report.verdict()) {
    case v1::Report::ADEQUATE:
      if (!FingerScatterWords(report).empty())
        return absl::StrCat("No effect on the mean is missing, but the fingers do not scatter alike: ",
                            FingerScatterWords(report), ".");
      if (report.has_sessions())
        return absl::StrCat("Nothing is missing and nothing changed: ", model,
                            " is as good as the touches of ", report.data_size(), " sessions can tell.");
      return absl::StrCat("Nothing is missing: ", model, " is as good as ", Readings(report), " can tell.");
    case v1::Report::WRONG_VALUES:
      return WrongValues(report);
    case v1::Report::MISSING_EFFECTS:
      return MissingEffects(report);
    case v1::Report::UNEXPLAINED:
      return Unexplained(report);
    case v1::Report::CHECK_DATA:
      return CheckData(report);
    case v1::Report::TOO_LITTLE_DATA:
      return TooLittle(report);
    default:
      return IsOfPlan(report) ? FirstSentence(report) : Compared(report);
  }
}

}  // namespace touchstone::client
