#include "server/effects/formula/user_term.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "server/base/text/text.h"

namespace touchstone::effects {

absl::Status CheckAdds(const model::UserTerm& term) {
  if (term.adds_grey != model::IsPhotoStage(term.stage) ||
      (term.adds_grey && (term.adds_time || term.stage != model::Stage::kImageSensor)))
    return absl::InvalidArgumentError(
        absl::StrCat("grey is added in the image sensor, travel_mm and time_us in the ",
                     "stages of a touch; this acts in the stage ", model::StageName(term.stage)));
  if (!term.adds_time || term.stage == model::Stage::kSensor) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("time_us can be added in the sensor stage only, not in the ",
                                                 model::StageName(term.stage),
                                                 " stage; there add travel_mm"));
}

absl::StatusOr<const FormulaVariable*> FindInput(absl::string_view kind, const model::UserTerm& term,
                                                 const std::string& name,
                                                 const std::vector<std::string>& also_known) {
  std::vector<std::string> known;
  for (const FormulaVariable& variable : FormulaVariables()) {
    known.push_back(variable.name);
    if (name != variable.name) continue;
    if (variable.since <= term.stage) return &variable;
    return absl::InvalidArgumentError(
        absl::StrCat(name, " is known from the ", model::StageName(variable.since), " stage on, and this ",
                     kind, " acts in the ", model::StageName(term.stage), " stage"));
  }
  if (absl::StartsWith(name, "cov_") && name.size() > 4) return nullptr;
  known.insert(known.end(), also_known.begin(), also_known.end());
  return absl::InvalidArgumentError(absl::StrCat("unknown ", kind == "lookup" ? "covariate" : "variable",
                                                 " '", name, "'", DidYouMean(name, known)));
}

void AddNeedsOf(const std::string& name, model::EffectNeeds* needs) {
  needs->curvature |= name == "curvature_per_m";
  needs->previous_press |= name == "previous_press_mm";
  needs->session_time |= name == "session_time_s" || name == "pause_s";
  if (absl::StartsWith(name, "cov_")) needs->covariates.push_back(name);
}

const double* ColumnOf(const std::string& name, const std::string& title, TouchBatch* touches) {
  const auto column = touches->covariates.find(name);
  if (column != touches->covariates.end()) return column->second.data();
  touches->formula_error =
      absl::StrCat(title, " needs the column ", name, ", which these touches do not have");
  return nullptr;
}

}  // namespace touchstone::effects
