#include "server/diagnosis/answers/plan_reports.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/answers/how_wrong.h"
#include "server/diagnosis/engine/competition/rules.h"
#include "server/diagnosis/selection/touch_modality.h"

namespace touchstone::diagnosis {
namespace {

// Effects of the plan's search, by what becomes of one of the size that rigs show.
struct Fates {
  std::vector<std::string> found, missed, untold;
};

Fates FatesOf(const std::vector<engine::DetectableValue>& values) {
  Fates fates;
  const auto add = [](const std::string& name, std::vector<std::string>* names) {
    if (names->empty() || names->back() != name) names->push_back(name);
  };
  for (size_t first = 0, end = 0; first < values.size(); first = end) {
    // The values of one effect follow each other.
    bool found = false, untold = true;
    for (end = first; end < values.size() && values[end].effect == values[first].effect; ++end) {
      if (values[end].power_at_typical < engine::kCompetitionRules.detection_power) continue;
      found = true;
      untold &= !values[end].told_from.has_value();
    }
    const std::string& name = values[first].effect->name;
    add(name, found ? &fates.found : &fates.missed);
    if (found && untold) add(name, &fates.untold);
  }
  return fates;
}

std::string Summary(const Fates& fates) {
  const size_t all = fates.found.size() + fates.missed.size();
  std::string text =
      absl::StrCat("Of ", all, " effects that the model lacks, this plan finds ", fates.found.size(),
                   " at the size that rigs usually show, in four of five sets.");
  if (!fates.missed.empty())
    absl::StrAppend(&text, " Not found at that size: ", absl::StrJoin(fates.missed, ", "), ".");
  if (!fates.untold.empty())
    absl::StrAppend(
        &text, " Found, and never told from what resembles them: ", absl::StrJoin(fates.untold, ", "), ".");
  return text;
}

}  // namespace

absl::StatusOr<report::Diagnosis> CheckTouchPlan(const DiagnosisInput& input,
                                                 const design::PlanQuestion& question,
                                                 const DiagnosisContext& context) {
  DiagnosisInput touches = input;
  touches.model = std::make_shared<const model::Model>(selection::TouchPartOf(*input.model));
  TOUCHSTONE_ASSIGN_OR_RETURN(design::PlanCheck check, design::CheckPlan(touches, question, context));
  report::Diagnosis diagnosis = BeginDiagnosis(*check.workspace);
  diagnosis.model_name = input.model->name;
  diagnosis.model_hash = input.model->Hash();
  engine::NoiseFloor floor;
  floor.sigma = Microseconds(check.sigma_s);
  diagnosis.data[0].noise_floor = floor;
  diagnosis.summary = Summary(FatesOf(check.values));
  diagnosis.detectable = std::move(check.values);
  diagnosis.next.assign(check.proposed.begin(), check.proposed.end());
  if (question.improve > 0 && check.proposed.empty())
    diagnosis.warnings.push_back(question.find.empty()
                                     ? absl::StrCat("No touch of this rig tells ", question.between[0],
                                                    " from ", question.between[1], ": ",
                                                    engine::DiscriminatingMeasurement(question.between))
                                     : absl::StrCat("No touch of this rig shows ", question.find,
                                                    " better than those of the plan do."));
  return diagnosis;
}

}  // namespace touchstone::diagnosis
