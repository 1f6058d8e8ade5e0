#include "server/diagnosis/report/kinds/from_distributions.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <utility>

#include "server/base/units.h"
#include "server/diagnosis/engine/competition/rules.h"
#include "server/diagnosis/report/words/summary.h"
#include "server/effects/all_effects.h"
#include "server/model/finger_name.h"
#include "server/session/images/emulated.h"
#include "server/session/measurements/touch_content.h"

namespace touchstone::diagnosis::report {
namespace {

using distributions::NoiseChange;
using distributions::PoseFreeComparison;

DataReport DataOf(const session::MeasurementSet& set, const distributions::PoseFreeRows& rows) {
  DataReport data;
  data.kind = DataKind::kDistributions;
  data.session = set.origin;
  data.emulated = session::CountEmulated(set);
  data.content_sha256 = session::TouchContentSha256(set);
  data.count = rows.compared;
  for (int i = 0; i < set.fingers; ++i) data.fingers.push_back(model::FingerName(i, set.fingers));
  data.rows = set.size();
  data.objects = set.objects;
  data.rounds = rows.rounds;
  data.missed_contacts = rows.missed_contacts;
  if (rows.incomplete > 0)
    data.set_aside.rows.push_back(
        {"a finger reported nothing: without poses only whole touches can be compared", rows.incomplete,
         rows.incomplete_examples});
  if (rows.thinned > 0)
    data.set_aside.rows.push_back(
        {"more touches than the comparison of distributions needs: thinned by whole poses",
         rows.thinned,
         {}});
  return data;
}

NoiseFloor FloorOfRounds(const distributions::RoundNoise& noise) {
  NoiseFloor floor;
  floor.sigma = Microseconds(noise.sigma_s);
  floor.lower = Microseconds(noise.lower_s);
  floor.upper = Microseconds(noise.upper_s);
  floor.degrees_of_freedom = noise.degrees_of_freedom;
  floor.from_repeats = true;
  return floor;
}

std::vector<std::string> Warnings(const PoseFreeComparison& comparison) {
  std::vector<std::string> warnings = {
      "no poses: times are compared as distributions, which is about two orders weaker than touch by touch; "
      "where on the object the model fails, and which effect is missing, cannot be known",
      absl::StrCat("no poses: the set is supposed to be made like this: ", comparison.plan,
                   "; another protocol or speed shows as a difference, too")};
  if (!comparison.noise_is_known)
    warnings.push_back(comparison.model_has_noise
                           ? "no rounds can be told apart: the noise is taken from the model as it is"
                           : "no rounds can be told apart and the model has no noise: nothing is known "
                             "about the noise, and its lack may be all that differs");
  if (comparison.size_ratio != 1)
    warnings.push_back(absl::StrFormat(
        "the measured times are %.2g times the simulated ones: is their unit us, and the mesh's mm?",
        comparison.size_ratio));
  return warnings;
}

// The noise that the rounds show is known for certain, whatever else is wrong: a step or a refit.
void AddNoiseChange(const PoseFreeComparison& comparison, Diagnosis* diagnosis) {
  if (comparison.noise_change == NoiseChange::kNone) return;
  diagnosis->improved_model = *comparison.model;
  const auto effect = effects::FindByRole(model::EffectRole::kNoiseLevel);
  engine::ParameterEstimate sigma;
  sigma.name = "sigma_us";
  sigma.unit = "us";
  sigma.value = Microseconds(comparison.noise->sigma_s);
  sigma.std_error = Microseconds(comparison.noise->std_error_s);
  sigma.lower = Microseconds(comparison.noise->lower_s);
  sigma.upper = Microseconds(comparison.noise->upper_s);
  if (comparison.noise_change == NoiseChange::kNewValue) {
    diagnosis->refitted.push_back({effect->name, {sigma}});
    return;
  }
  Step step;
  step.effect = effect->name;
  step.probability = engine::kCompetitionRules.max_probability;
  step.meaning = effect->meaning;
  step.check_on_rig = effect->check_on_rig;
  step.remedy = effect->remedy;
  step.parameters = {sigma};
  diagnosis->steps.push_back(std::move(step));
  diagnosis->data[0].after_step.push_back({0, 0, comparison.p_value});
}

engine::Verdict VerdictOf(const PoseFreeComparison& comparison) {
  if (!comparison.diagnosed) return engine::Verdict::kNone;
  if (!comparison.compatible || !comparison.findings.empty()) return engine::Verdict::kUnexplained;
  return comparison.noise_change == NoiseChange::kNewEffect ? engine::Verdict::kMissingEffects
                                                            : engine::Verdict::kAdequate;
}

}  // namespace

Diagnosis FromDistributions(const DiagnosisInput& input, PoseFreeComparison comparison) {
  Diagnosis diagnosis;
  diagnosis.model_name = input.model->name;
  diagnosis.model_hash = input.model->Hash();
  diagnosis.data = {DataOf(*input.set, comparison.rows)};
  DataReport& data = diagnosis.data[0];
  if (comparison.noise) data.noise_floor = FloorOfRounds(*comparison.noise);
  data.initial = Quality{0, 0, comparison.p_value};
  if (comparison.diagnosed) {
    data.final = data.initial;
    AddNoiseChange(comparison, &diagnosis);
  }
  diagnosis.verdict = VerdictOf(comparison);
  diagnosis.warnings = Warnings(comparison);
  if (data.emulated > 0) diagnosis.warnings.push_back(EmulatedInWords(data));
  data.histograms = std::move(comparison.histograms);
  data.distributions = std::move(comparison);
  diagnosis.summary = Summarize(diagnosis);
  return diagnosis;
}

}  // namespace touchstone::diagnosis::report
