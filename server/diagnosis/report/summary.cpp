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
std::string Value(const engine::ParameterEstimate& value) {
  std::string name = value.name;
  if (!value.entry.empty()) name += " " + value.entry;
  return absl::StrFormat("%s %.4g +- %.2g%s%s", name, value.value, value.std_error,
                         value.unit.empty() ? "" : " ", value.unit);
}

std::string HowWrong(const Diagnosis& diagnosis) {
  const double rmse_s = diagnosis.initial ? diagnosis.initial->rmse : 0;
  if (!diagnosis.noise_floor || !(diagnosis.noise_floor->sigma > 0))
    return absl::StrCat("The model is off by ", TimeInWords(rmse_s), ".");
  return absl::StrFormat(
      "The model is off by %s; %s is noise%s, so %.3g %% of the mean square error is the model's.",
      TimeInWords(rmse_s), TimeInWords(diagnosis.noise_floor->sigma),
      diagnosis.noise_floor->from_repeats ? "" : " at most", diagnosis.reducible_share * 100);
}

// Repeats that scatter by more or by less than the model says. Empty: as it says.
std::string FloorAgainstModel(const engine::NoiseFloor& floor) {
  constexpr double kBeyond = 1.7;  // half widths of the 95 % interval: 3.3 standard errors
  constexpr double kRelevant = 0.02;
  if (!floor.from_repeats || !(floor.declared > 0)) return "";
  const double apart_s = floor.sigma - floor.declared;
  if (std::abs(apart_s) < kRelevant * floor.declared ||
      std::abs(apart_s) < kBeyond * 0.5 * (floor.upper - floor.lower))
    return "";
  return absl::StrFormat(
      "Repeats scatter by %s (%s to %s), where the model says %s of noise: %s", TimeInWords(floor.sigma),
      TimeInWords(floor.lower), TimeInWords(floor.upper), TimeInWords(floor.declared),
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
std::string TimeInRepeats(const engine::NoiseFloor& floor) {
  return absl::StrFormat(
      "Repeats of a touch differ by %s, but touches made one after the other by %s only (z %.1f): something "
      "changes slowly through the session, and that is not noise.",
      TimeInWords(floor.sigma), TimeInWords(floor.sigma_without_time), floor.time_structure_z);
}

std::string WhatRemains(const engine::UnexplainedRest& rest) {
  if (rest.formula.empty() && !rest.lookup_yaml.empty() && !rest.covariates.empty())
    return absl::StrCat("What remains follows no effect of the catalogue; it depends on ",
                        rest.covariates[0].name, " along a curve that would leave ", TimeInWords(rest.rmse),
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
                      ") would leave ", TimeInWords(rest.rmse), ".");
}

constexpr char kNoTouch[] = "No touch could be used: nothing can be said of the model.";

}  // namespace

std::string ValuesInWords(const std::vector<engine::ParameterEstimate>& parameters) {
  constexpr int kMaxShown = 4;
  if (parameters.size() > kMaxShown) return absl::StrCat(parameters.size(), " values");
  std::vector<std::string> texts;
  for (const engine::ParameterEstimate& value : parameters) texts.push_back(Value(value));
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
  for (const engine::RefittedEffect& refit : diagnosis.refitted)
    sentences.push_back(absl::StrCat("In the model ", refit.effect,
                                     " has another value: ", ValuesInWords(refit.parameters), "."));
  for (const std::string& effect : diagnosis.superfluous) sentences.push_back(SuperfluousInWords(effect));
  for (const engine::LadderStep& step : diagnosis.steps) {
    std::string name = step.effect;
    for (const std::string& other : step.equivalent) absl::StrAppend(&name, " or ", other);
    sentences.push_back(absl::StrCat("Missing: ", name, " (", ValuesInWords(step.parameters), ")."));
    if (!step.equivalent.empty())
      sentences.push_back(
          absl::StrCat("These data cannot tell them apart. ", step.discriminating_measurement));
    if (!step.words.empty()) sentences.push_back(step.words);
  }
  switch (diagnosis.verdict) {
    case engine::Verdict::kAdequate:
      sentences.push_back(
          absl::StrCat("Nothing ", others_in_place ? "else " : "", "is missing that these data could show."));
      break;
    case engine::Verdict::kUnexplained:
      if (diagnosis.noise_floor && selection::SharesTime(*diagnosis.noise_floor))
        sentences.push_back(TimeInRepeats(*diagnosis.noise_floor));
      sentences.push_back(WhatRemains(*diagnosis.unexplained));
      break;
    case engine::Verdict::kMissingEffects:
    case engine::Verdict::kWrongValues:
      sentences.push_back(absl::StrCat("Then ", TimeInWords(diagnosis.final->rmse), " is left."));
      break;
    case engine::Verdict::kCheckData:
      for (const engine::DataProblem& problem : diagnosis.data_problems)
        sentences.push_back(
            absl::StrCat(problem.words, problem.fix.empty() ? "" : " Fix it with: ", problem.fix));
      break;
    case engine::Verdict::kTooLittleData:
      sentences.push_back(absl::StrCat("That is too little for a verdict; ", diagnosis.touches_needed,
                                       " usable touches would do."));
      break;
    case engine::Verdict::kNone:
      break;
  }
  return absl::StrJoin(sentences, " ");
}

}  // namespace touchstone::diagnosis::report
