#include "server/diagnosis/report/photograph_summary.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/diagnosis/report/summary.h"

namespace touchstone::diagnosis::report {
namespace {

constexpr int kFewPictures = 30;

std::string Grey(double grey) {
  return absl::StrFormat("%.3g grey levels", grey);
}

std::string HowWrongInGrey(const images::PhotographDiagnosis& diagnosis) {
  const double rmse = diagnosis.initial ? diagnosis.initial->rmse : 0;
  if (!(diagnosis.noise_floor.sigma > 0)) return absl::StrCat("The model is off by ", Grey(rmse), ".");
  return absl::StrFormat(
      "The model is off by %s; %s is noise%s, so %.3g %% of the mean square error is the model's.",
      Grey(rmse), Grey(diagnosis.noise_floor.sigma), diagnosis.noise_floor.from_repeats ? "" : " at most",
      diagnosis.reducible_share * 100);
}

std::string RestInWords(const engine::UnexplainedRest& rest) {
  std::string text = "What remains follows no effect of the catalogue";
  if (!rest.covariates.empty()) absl::StrAppend(&text, "; it depends on ", rest.covariates[0].name);
  if (!rest.formula.empty())
    absl::StrAppend(&text, ". A suggestion: ", rest.formula, " would leave ", Grey(rest.rmse));
  else if (!rest.lookup_yaml.empty())
    absl::StrAppend(&text, " along a curve that would leave ", Grey(rest.rmse));
  return absl::StrCat(text, ".", rest.words.empty() ? "" : " ", rest.words);
}

void AddSteps(const images::PhotographDiagnosis& diagnosis, std::vector<std::string>* sentences) {
  for (const engine::RefittedEffect& refit : diagnosis.refitted)
    sentences->push_back(absl::StrCat("In the model ", refit.effect,
                                      " has another value: ", ValuesInWords(refit.parameters), "."));
  for (const std::string& effect : diagnosis.superfluous)
    sentences->push_back(absl::StrCat("The data do without ", effect, " (`touchstone model remove MODEL ",
                                      effect, " -o NEW`)."));
  for (const engine::LadderStep& step : diagnosis.steps) {
    std::string name = step.effect;
    for (const std::string& other : step.equivalent) absl::StrAppend(&name, " or ", other);
    sentences->push_back(absl::StrCat("Missing: ", name, " (", ValuesInWords(step.parameters), ")."));
    if (!step.equivalent.empty())
      sentences->push_back(
          absl::StrCat("These pictures cannot tell them apart. ", step.discriminating_measurement));
    if (!step.words.empty()) sentences->push_back(step.words);
  }
}

}  // namespace

std::string Summarize(const images::PhotographDiagnosis& diagnosis, bool others_in_place) {
  if (diagnosis.images == 0) return "No picture could be used: nothing can be said of the model.";
  std::vector<std::string> sentences = {HowWrongInGrey(diagnosis)};
  AddSteps(diagnosis, &sentences);
  switch (diagnosis.verdict) {
    case engine::Verdict::kAdequate:
      sentences.push_back(absl::StrCat("Nothing ", others_in_place ? "else " : "",
                                       "is missing that these pictures could show."));
      break;
    case engine::Verdict::kUnexplained:
      sentences.push_back(diagnosis.unexplained
                              ? RestInWords(*diagnosis.unexplained)
                              : "A structure remains that no effect of the catalogue explains.");
      break;
    case engine::Verdict::kMissingEffects:
    case engine::Verdict::kWrongValues:
      if (diagnosis.final)
        sentences.push_back(absl::StrCat("Then ", Grey(diagnosis.final->rmse), " is left."));
      break;
    case engine::Verdict::kCheckData:
      for (const engine::DataProblem& problem : diagnosis.data_problems)
        sentences.push_back(
            absl::StrCat(problem.words, problem.fix.empty() ? "" : " Fix it with: ", problem.fix));
      break;
    case engine::Verdict::kTooLittleData:
      sentences.push_back(absl::StrCat("That is too little for a verdict; pictures from ",
                                       diagnosis.images_needed, " poses would do."));
      break;
    case engine::Verdict::kNone:
      break;
  }
  return absl::StrJoin(sentences, " ");
}

std::vector<std::string> PhotographWarnings(const images::PhotographDiagnosis& diagnosis,
                                            const session::ImageSet& set) {
  std::vector<std::string> warnings;
  if (diagnosis.images < kFewPictures)
    warnings.push_back(absl::StrCat("Only ", diagnosis.images,
                                    diagnosis.images == 1 ? " picture" : " pictures",
                                    " took part: weak effects stay unseen, and errors are rough."));
  if (set.objects.size() == 1)
    warnings.push_back(
        "One object only: what belongs to the camera and what to this object cannot be told apart well.");
  const auto blind = std::count_if(diagnosis.photographs.begin(), diagnosis.photographs.end(),
                                   [](const auto& error) { return std::isnan(error.silhouette_iou); });
  if (blind > 0)
    warnings.push_back(
        absl::StrCat(blind, " of ", diagnosis.photographs.size(),
                     " pictures show no background to tell the object's outline from: they take no "
                     "part in the silhouettes."));
  const auto coloured = std::any_of(set.photographs.begin(), set.photographs.end(),
                                    [](const auto& row) { return row.channels == 3; });
  if (coloured)
    warnings.push_back(
        "Colour pictures are compared as the mean of their three channels: a model knows no colour.");
  return warnings;
}

}  // namespace touchstone::diagnosis::report
