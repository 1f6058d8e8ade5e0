#include "server/diagnosis/report/words/summary.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/text/readable_time.h"
#include "server/base/text/text.h"
#include "server/base/text/value_text.h"
#include "server/base/units.h"
#include "server/diagnosis/engine/ladder/rules.h"
#include "server/diagnosis/report/words/distributions_summary.h"
#include "server/diagnosis/report/words/rules.h"
#include "server/diagnosis/selection/session/time_structure.h"
#include "server/effects/all_effects.h"
#include "server/session/images/emulated.h"

namespace touchstone::diagnosis::report {
namespace {

// How a kind's measurements are called.
struct Words {
  const char *one, *many, *these;
};

Words WordsOf(DataKind kind) {
  switch (kind) {
    case DataKind::kTouches:
    case DataKind::kDistributions:
      break;
    case DataKind::kPhotographs:
    case DataKind::kBoards:
      return {"picture", "pictures", "these pictures"};
  }
  return {"touch", "touches", "these data"};
}

std::string NothingUsed(DataKind kind) {
  return absl::StrCat("No ", WordsOf(kind).one, " could be used: nothing can be said of the model.");
}

std::string Enough(const DataReport& data) {
  return data.kind == DataKind::kPhotographs
             ? absl::StrFormat("pictures from %d poses would do.", data.needed)
             : absl::StrFormat("%d usable touches would do.", data.needed);
}

std::string HowWrong(const DataReport& data) {
  const double rmse = data.initial ? data.initial->rmse : 0;
  if (!data.noise_floor || !(data.noise_floor->sigma > 0))
    return absl::StrCat("The model is off by ", ErrorInWords(data.kind, rmse), ".");
  if (data.noise_floor->is_rounding && rmse <= data.noise_floor->sigma)
    return "The model agrees with the data to the rounding of files and meshes.";
  const double floor = data.noise_floor->sigma;
  std::string off = ErrorInWords(data.kind, rmse);
  if (data.set_aside.outliers > 0) {
    // The share is of the others, and so is this error.
    const double others = floor / std::sqrt(std::max(1 - data.reducible_share, 1e-12));
    absl::StrAppend(&off, " with the ", data.set_aside.outliers, " set aside, and by ",
                    others > floor ? "" : "no more than ", ErrorInWords(data.kind, others), " without them");
  }
  return absl::StrFormat(
      "The model is off by %s; %s is noise%s, so %.3g %% of the mean square error%s is the model's.", off,
      ErrorInWords(data.kind, floor), data.noise_floor->from_repeats ? "" : " at most",
      data.reducible_share * 100, data.set_aside.outliers > 0 ? " of those" : "");
}

// Repeats that scatter by more or by less than the model says. Empty: as it says.
std::string FloorAgainstModel(DataKind kind, const NoiseFloor& floor) {
  if (!floor.from_repeats || !(floor.declared > 0)) return "";
  const double apart = floor.sigma - floor.declared;
  if (std::abs(apart) < kWordsRules.noise_differs_share * floor.declared ||
      std::abs(apart) < kWordsRules.noise_differs_widths * 0.5 * (floor.upper - floor.lower))
    return "";
  return absl::StrFormat(
      "Repeats scatter by %s (%s to %s), where the model says %s of noise: %s",
      ErrorInWords(kind, floor.sigma), ErrorInWords(kind, floor.lower), ErrorInWords(kind, floor.upper),
      ErrorInWords(kind, floor.declared),
      apart > 0 ? "either the noise has grown, or something that differs between repeats is taken for it."
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
std::string TimeInRepeats(DataKind kind, const NoiseFloor& floor) {
  return absl::StrFormat(
      "Repeats of a touch differ by %s, but touches made one after the other by %s only (z %.1f): something "
      "changes slowly through the session, and that is not noise.",
      ErrorInWords(kind, floor.sigma), ErrorInWords(kind, floor.sigma_without_time), floor.time_structure_z);
}

std::string WhatRemains(DataKind kind, const Unexplained& rest) {
  const std::string on = rest.covariates.empty() ? "" : rest.covariates[0].name;
  const std::string left = ErrorInWords(kind, rest.rmse);
  const std::string words = rest.words.empty() ? "" : absl::StrCat(" ", rest.words);
  if (!rest.formula.empty())
    return absl::StrCat(
        "What remains follows no effect of the catalogue; it depends on ", on.empty() ? "something" : on,
        ". A suggestion: ", rest.formula,
        rest.parameters.empty() ? "" : absl::StrCat(" (", ValuesInWords(rest.parameters), ")"),
        " would leave ", left, ".", words);
  if (!rest.lookup_yaml.empty() && !on.empty())
    return absl::StrCat("What remains follows no effect of the catalogue; it depends on ", on,
                        " along a curve that would leave ", left, ".", words);
  if (!on.empty())
    return absl::StrCat("What remains depends on ", on, "; no effect of the catalogue explains it.", words);
  return rest.words.empty()
             ? "A structure remains that neither an effect of the catalogue nor a simple formula explains."
             : rest.words;
}

void AddCauses(const Diagnosis& diagnosis, std::vector<std::string>* sentences) {
  for (const engine::RefittedEffect& refit : diagnosis.refitted)
    sentences->push_back(absl::StrCat("In the model ", refit.effect,
                                      " has another value: ", ValuesInWords(refit.parameters), "."));
  for (const std::string& effect : diagnosis.superfluous) sentences->push_back(SuperfluousInWords(effect));
  std::string these = WordsOf(diagnosis.data[0].kind).these;
  these[0] = 'T';
  for (const Step& step : diagnosis.steps) {
    std::string name = step.effect;
    for (const std::string& other : step.equivalent) absl::StrAppend(&name, " or ", other);
    const bool doubtful = diagnosis.verdict == engine::Verdict::kUnexplained &&
                          step.probability <= engine::kLadderRules.doubted;
    sentences->push_back(absl::StrCat(doubtful ? "May stand in for a part of what is missing: " : "Missing: ",
                                      name, " (", ValuesInWords(step.parameters), ")."));
    if (!step.equivalent.empty())
      sentences->push_back(absl::StrCat(these, " cannot tell them apart. ", step.discriminating_measurement));
    if (!step.words.empty()) sentences->push_back(step.words);
  }
}

void AddVerdict(const Diagnosis& diagnosis, bool others_in_place, std::vector<std::string>* sentences) {
  const DataReport& data = diagnosis.data[0];
  switch (diagnosis.verdict) {
    case engine::Verdict::kAdequate:
      sentences->push_back(absl::StrCat("Nothing ", others_in_place ? "else " : "", "is missing that ",
                                        WordsOf(data.kind).these, " could show."));
      break;
    case engine::Verdict::kUnexplained:
      if (data.noise_floor && selection::SharesTime(*data.noise_floor))
        sentences->push_back(TimeInRepeats(data.kind, *data.noise_floor));
      sentences->push_back(WhatRemains(data.kind, data.unexplained.value_or(Unexplained())));
      break;
    case engine::Verdict::kMissingEffects:
    case engine::Verdict::kWrongValues:
      if (data.final)
        sentences->push_back(absl::StrCat("Then ", ErrorInWords(data.kind, data.final->rmse), " is left."));
      break;
    case engine::Verdict::kCheckData:
      for (const DataProblem& problem : diagnosis.data_problems)
        sentences->push_back(
            absl::StrCat(problem.words, problem.fix.empty() ? "" : " Fix it with: ", problem.fix));
      sentences->push_back("P(nothing is missing) is not assessed: a mistake in the data comes first.");
      break;
    case engine::Verdict::kTooLittleData:
      sentences->push_back(absl::StrCat("That is too little for a verdict; ", Enough(data)));
      break;
    case engine::Verdict::kNone:
      break;
  }
}

void AddPhotographWarnings(const DataReport& data, std::vector<std::string>* warnings) {
  const auto& errors = data.photographs->photographs;
  const auto blind = std::count_if(errors.begin(), errors.end(),
                                   [](const auto& error) { return std::isnan(error.silhouette_iou); });
  if (blind > 0)
    warnings->push_back(absl::StrCat(
        blind, " of ", errors.size(),
        " pictures show no background to tell the object's outline from: they take no part in the "
        "silhouettes."));
  if (data.photographs->coloured)
    warnings->push_back(
        "Colour pictures are compared as the mean of their three channels: a model knows no colour.");
}

void AddTouchWarnings(const DataReport& data, std::vector<std::string>* warnings) {
  if (data.repeats == 0)
    warnings->push_back(
        "No touch was repeated: the noise floor is an upper bound, taken from what the best model leaves.");
  const int unused = data.set_aside.count();
  if (unused * 5 > data.rows)
    warnings->push_back(
        absl::StrFormat("%d of %d rows could not be used; see the reasons.", unused, data.rows));
  if (const session::BackwardTimes& backward = data.backward_times; backward.rows > 0)
    warnings->push_back(absl::StrCat(
        "session_time_s goes backwards at ", backward.rows, backward.rows == 1 ? " row" : " rows",
        ", first from ", ShortestNumber(backward.before_s), " to ", ShortestNumber(backward.time_s),
        " s at touch ", backward.touch,
        ": what drifts with time is judged as if one clock ran on; give sessions as files of their own."));
}

}  // namespace

std::string ValueInWords(const engine::ParameterEstimate& value) {
  std::string name = value.name;
  if (!value.entry.empty()) name += " " + value.entry;
  return absl::StrCat(name, " ", ValueWithError(value.value, value.std_error), value.unit.empty() ? "" : " ",
                      value.unit);
}

std::string ErrorInWords(DataKind kind, double error) {
  switch (kind) {
    case DataKind::kTouches:
    case DataKind::kDistributions:
      return TimeInWords(error * kSecondsPerMicrosecond);
    case DataKind::kPhotographs:
      return absl::StrFormat("%.3g grey levels", error);
    case DataKind::kBoards:
      return absl::StrFormat("%.3g px", error);
  }
  return "";
}

std::string ValuesInWords(const std::vector<engine::ParameterEstimate>& parameters) {
  if (parameters.size() > kWordsRules.max_values_shown) return absl::StrCat(parameters.size(), " values");
  std::vector<std::string> texts;
  for (const engine::ParameterEstimate& value : parameters) texts.push_back(ValueInWords(value));
  return absl::StrJoin(texts, ", ");
}

std::string EmulatedInWords(const DataReport& data) {
  if (data.emulated == 0) return "";
  return absl::StrCat(
      data.emulated < data.rows ? absl::StrCat(data.emulated, " of ", data.rows) : std::string("The"),
      data.kind == DataKind::kPhotographs ? " photographs" : " touches", " are emulated (",
      session::kEmulatedCovariate, "): an emulator made them, and they measure nothing.");
}

std::vector<std::string> DataWarnings(const DataReport& data) {
  std::vector<std::string> warnings;
  const Words words = WordsOf(data.kind);
  const bool touches = data.kind == DataKind::kTouches;
  if (data.emulated > 0) warnings.push_back(EmulatedInWords(data));
  if (touches && data.count == 0) {
    warnings.push_back(NothingUsed(data.kind));
    return warnings;
  }
  if (data.count < (touches ? kWordsRules.few_touches.value() : kWordsRules.few_pictures.value()))
    warnings.push_back(absl::StrCat("Only ", data.count, " ", data.count == 1 ? words.one : words.many,
                                    " took part: weak effects stay unseen, and errors are rough."));
  if (data.objects.size() == 1)
    warnings.push_back(absl::StrCat("One object only: what belongs to the ", touches ? "rig" : "camera",
                                    " and what to this object cannot be told apart well.",
                                    touches ? " Touch at least three objects." : ""));
  if (data.photographs) AddPhotographWarnings(data, &warnings);
  if (touches) AddTouchWarnings(data, &warnings);
  return warnings;
}

std::string Summarize(const Diagnosis& diagnosis, bool others_in_place) {
  const DataReport& data = diagnosis.data[0];
  if (data.distributions) return SummarizeDistributions(diagnosis);
  if (data.count == 0 && diagnosis.data_problems.empty())
    return data.needed == 0 ? NothingUsed(data.kind)
                            : absl::StrCat(NothingUsed(data.kind), " ", Enough(data));
  std::vector<std::string> sentences = {HowWrong(data)};
  if (data.noise_floor)
    if (std::string words = FloorAgainstModel(data.kind, *data.noise_floor); !words.empty())
      sentences.push_back(std::move(words));
  AddCauses(diagnosis, &sentences);
  AddVerdict(diagnosis, others_in_place, &sentences);
  return absl::StrJoin(sentences, " ");
}

}  // namespace touchstone::diagnosis::report
