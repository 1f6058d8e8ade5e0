#include "server/diagnosis/report/summary.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/readable_time.h"
#include "server/diagnosis/selection/time_structure.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::report {
namespace {

constexpr int kFewTouches = 100;

// "radius_mm 1.5 +- 0.005 mm"
std::string Value(const inference::ParameterEstimate& value) {
  std::string name = value.name;
  if (!value.entry.empty()) name += " " + value.entry;
  return absl::StrFormat("%s %.4g +- %.2g%s%s", name, value.value, value.std_error,
                         value.unit.empty() ? "" : " ", value.unit);
}

std::string HowWrong(const Diagnosis& diagnosis) {
  const double rmse_s = diagnosis.initial ? diagnosis.initial->rmse_s : 0;
  if (!diagnosis.noise_floor || !(diagnosis.noise_floor->sigma_s > 0))
    return absl::StrCat("The model is off by ", TimeInWords(rmse_s), ".");
  return absl::StrFormat(
      "The model is off by %s; %s is noise%s, so %.3g %% of the mean square error is the model's.",
      TimeInWords(rmse_s), TimeInWords(diagnosis.noise_floor->sigma_s),
      diagnosis.noise_floor->from_repeats ? "" : " at most", diagnosis.reducible_share * 100);
}

// Repeats that scatter by more or by less than the model says. Empty: as it says.
std::string FloorAgainstModel(const selection::NoiseFloor& floor) {
  constexpr double kBeyond = 1.7;  // half widths of the 95 % interval: 3.3 standard errors
  constexpr double kRelevant = 0.02;
  if (!floor.from_repeats || !(floor.declared_s > 0)) return "";
  const double apart_s = floor.sigma_s - floor.declared_s;
  if (std::abs(apart_s) < kRelevant * floor.declared_s ||
      std::abs(apart_s) < kBeyond * 0.5 * (floor.upper_s - floor.lower_s))
    return "";
  return absl::StrFormat(
      "Repeats scatter by %s (%s to %s), where the model says %s of noise: %s", TimeInWords(floor.sigma_s),
      TimeInWords(floor.lower_s), TimeInWords(floor.upper_s), TimeInWords(floor.declared_s),
      apart_s > 0 ? "either the noise has grown, or something that differs between repeats is taken for it."
                  : "the rig is quieter than its model.");
}

std::string SuperfluousInWords(const std::string& name) {
  const auto effect = effects::Catalogue().Find(name);
  return absl::StrCat("The data do without ", name,
                      effect != nullptr && effect->random() ? ": their scatter shows no trace of it"
                                                            : ": its value is zero as far as they can tell",
                      " (`touchstone model remove MODEL ", name, " -o NEW`).");
}

// Repeats that have a course in time in common scatter by more than noise.
std::string TimeInRepeats(const selection::NoiseFloor& floor) {
  return absl::StrFormat(
      "Repeats of a touch differ by %s, but touches made one after the other by %s only (z %.1f): something "
      "changes slowly through the session, and that is not noise.",
      TimeInWords(floor.sigma_s), TimeInWords(floor.sigma_without_time_s), floor.time_structure_z);
}

std::string WhatRemains(const selection::UnexplainedRest& rest) {
  if (rest.formula.empty() && !rest.lookup_yaml.empty() && !rest.covariates.empty())
    return absl::StrCat("What remains follows no effect of the catalogue; it depends on ",
                        rest.covariates[0].name, " along a curve that would leave ", TimeInWords(rest.rmse_s),
                        ".", rest.words.empty() ? "" : " ", rest.words);
  if (rest.formula.empty() && !rest.covariates.empty())
    return absl::StrCat("What remains depends on ", rest.covariates[0].name,
                        "; no effect of the catalogue explains it.");
  if (rest.formula.empty() && !rest.words.empty()) return rest.words;
  if (rest.formula.empty())
    return "A structure remains that neither an effect of the catalogue nor a simple formula explains.";
  return absl::StrCat("What remains follows no effect of the catalogue; it depends on ",
                      rest.covariates.empty() ? "something" : rest.covariates[0].name,
                      ". A suggestion: ", rest.formula, " (", ValuesInWords(rest.parameters),
                      ") would leave ", TimeInWords(rest.rmse_s), ".");
}

constexpr char kNoTouch[] = "No touch could be used: nothing can be said of the model.";

}  // namespace

std::string ValuesInWords(const std::vector<inference::ParameterEstimate>& parameters) {
  constexpr int kMaxShown = 4;
  if (parameters.size() > kMaxShown) return absl::StrCat(parameters.size(), " values");
  std::vector<std::string> texts;
  for (const inference::ParameterEstimate& value : parameters) texts.push_back(Value(value));
  return absl::StrJoin(texts, ", ");
}

std::vector<std::string> DataWarnings(const touches::DataSummary& data) {
  if (data.touches == 0) return {kNoTouch};
  std::vector<std::string> warnings;
  if (data.touches < kFewTouches)
    warnings.push_back(absl::StrCat("Only ", data.touches, data.touches == 1 ? " touch" : " touches",
                                    " took part: weak effects stay unseen, and errors are rough."));
  if (data.objects.size() == 1)
    warnings.push_back(
        "One object only: what belongs to the rig and what to this object cannot be told apart well. Touch "
        "at least three objects.");
  if (data.repeats == 0)
    warnings.push_back(
        "No touch was repeated: the noise floor is an upper bound, taken from what the best model leaves.");
  int unused = 0;
  for (const auto& [reason, touches] : data.unused) unused += touches.count;
  if (unused * 5 > data.rows)
    warnings.push_back(
        absl::StrFormat("%d of %d rows could not be used; see the reasons.", unused, data.rows));
  return warnings;
}

std::string Summarize(const Diagnosis& diagnosis, bool others_in_place) {
  if (diagnosis.data.touches == 0 && diagnosis.data_problems.empty()) {
    if (diagnosis.touches_needed == 0) return kNoTouch;
    return absl::StrCat(kNoTouch, " ", diagnosis.touches_needed, " usable touches would do.");
  }
  std::vector<std::string> sentences = {HowWrong(diagnosis)};
  if (diagnosis.noise_floor)
    if (std::string words = FloorAgainstModel(*diagnosis.noise_floor); !words.empty())
      sentences.push_back(std::move(words));
  for (const selection::RefittedEffect& refit : diagnosis.refitted)
    sentences.push_back(absl::StrCat("In the model ", refit.effect,
                                     " has another value: ", ValuesInWords(refit.parameters), "."));
  for (const std::string& effect : diagnosis.superfluous) sentences.push_back(SuperfluousInWords(effect));
  for (const selection::LadderStep& step : diagnosis.steps) {
    std::string name = step.effect;
    for (const std::string& other : step.equivalent) absl::StrAppend(&name, " or ", other);
    sentences.push_back(absl::StrCat("Missing: ", name, " (", ValuesInWords(step.parameters), ")."));
    if (!step.equivalent.empty())
      sentences.push_back(
          absl::StrCat("These data cannot tell them apart. ", step.discriminating_measurement));
    if (!step.words.empty()) sentences.push_back(step.words);
  }
  switch (diagnosis.verdict) {
    case selection::Verdict::kAdequate:
      sentences.push_back(
          absl::StrCat("Nothing ", others_in_place ? "else " : "", "is missing that these data could show."));
      break;
    case selection::Verdict::kUnexplained:
      if (diagnosis.noise_floor && selection::SharesTime(*diagnosis.noise_floor))
        sentences.push_back(TimeInRepeats(*diagnosis.noise_floor));
      sentences.push_back(WhatRemains(*diagnosis.unexplained));
      break;
    case selection::Verdict::kMissingEffects:
    case selection::Verdict::kWrongValues:
      sentences.push_back(absl::StrCat("Then ", TimeInWords(diagnosis.final->rmse_s), " is left."));
      break;
    case selection::Verdict::kCheckData:
      for (const selection::DataProblem& problem : diagnosis.data_problems)
        sentences.push_back(
            absl::StrCat(problem.words, problem.fix.empty() ? "" : " Fix it with: ", problem.fix));
      break;
    case selection::Verdict::kTooLittleData:
      sentences.push_back(absl::StrCat("That is too little for a verdict; ", diagnosis.touches_needed,
                                       " usable touches would do."));
      break;
    case selection::Verdict::kNone:
      break;
  }
  return absl::StrJoin(sentences, " ");
}

}  // namespace touchstone::diagnosis::report
