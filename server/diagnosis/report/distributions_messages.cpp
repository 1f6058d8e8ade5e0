#include "server/diagnosis/report/distributions_messages.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>

#include "server/base/readable_time.h"
#include "server/base/units.h"
#include "server/diagnosis/engine/result.h"
#include "server/diagnosis/report/residuals_messages.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::report {
namespace {

std::string PInWords(const distributions::PoseFreeComparison& comparison) {
  return absl::StrCat("(p = ", absl::StrFormat("%.2g", comparison.p_value), ")");
}

void WriteRows(const session::MeasurementSet& set, const distributions::PoseFreeRows& rows,
               v1::Report* report) {
  report->set_touches(rows.compared);
  for (int i = 0; i < set.fingers; ++i) report->add_fingers(model::FingerName(i, set.fingers));
  v1::DataSummary* data = report->mutable_data();
  data->set_rows(set.size());
  data->set_origin(set.origin);
  *data->mutable_objects() = {set.objects.begin(), set.objects.end()};
  data->set_rounds(rows.rounds);
  data->set_missed_contacts(rows.missed_contacts);
  if (rows.incomplete > 0) {
    v1::UnusedRows* unused = data->add_unused();
    unused->set_rows(rows.incomplete);
    unused->set_reason("a finger reported nothing: without poses only whole touches can be compared");
    *unused->mutable_examples() = {rows.incomplete_examples.begin(), rows.incomplete_examples.end()};
  }
  if (rows.thinned > 0) {
    v1::UnusedRows* thinned = data->add_unused();
    thinned->set_rows(rows.thinned);
    thinned->set_reason("more touches than the comparison of distributions needs: thinned by whole poses");
  }
}

void WriteNoiseFloor(const distributions::RoundNoise& noise, v1::Report* report) {
  report->set_noise_floor_us(noise.sigma_s * kMicrosecondsPerSecond);
  v1::NoiseFloor* floor = report->mutable_noise_floor();
  floor->set_sigma_us(noise.sigma_s * kMicrosecondsPerSecond);
  floor->set_degrees_of_freedom(static_cast<uint32_t>(noise.degrees_of_freedom));
  floor->set_lower_us(noise.lower_s * kMicrosecondsPerSecond);
  floor->set_upper_us(noise.upper_s * kMicrosecondsPerSecond);
  floor->set_from_repeats(true);
}

const char* NameOf(distributions::RoundFindingKind kind) {
  switch (kind) {
    case distributions::RoundFindingKind::kSession:
      return "session";
    case distributions::RoundFindingKind::kPreviousPress:
      return "previous_press";
    case distributions::RoundFindingKind::kTails:
      return "tails";
    case distributions::RoundFindingKind::kTicks:
      return "ticks";
  }
  return "";
}

// "Repeats of ... (p 3e-12). Compatible effects: a, b. "
std::string FindingsInWords(const std::vector<distributions::RoundFinding>& findings) {
  std::string words;
  for (const distributions::RoundFinding& finding : findings)
    absl::StrAppend(&words, finding.words, " ",
                    finding.p_value < 1e-15 ? "p < 1e-15." : absl::StrFormat("p = %.1g.", finding.p_value),
                    finding.compatible.empty()
                        ? ""
                        : absl::StrCat(" In the catalogue ", absl::StrJoin(finding.compatible, ", "),
                                       " would do that; which it is, if it is one, these data cannot tell."),
                    " ");
  return words;
}

void WriteTest(const distributions::PoseFreeComparison& comparison, v1::Report* report) {
  report->mutable_initial()->set_lack_of_fit_p(comparison.p_value);
  v1::DistributionComparison* distributions = report->mutable_distributions();
  distributions->set_energy_distance(comparison.energy_distance_s * kMicrosecondsPerSecond);
  distributions->set_p(comparison.energy_p_value);
  distributions->set_plan(comparison.plan);
  distributions->set_simulated_touches(comparison.simulated_touches);
  for (const distributions::StatisticComparison& statistic : comparison.statistics) {
    v1::StatisticTest* test = distributions->add_statistics();
    test->set_name(statistic.name);
    test->set_unit(statistic.unit);
    test->set_measured(statistic.measured);
    test->set_simulated(statistic.simulated);
    test->set_p(statistic.p_value);
  }
  for (const distributions::CompatibleEffect& effect : comparison.compatible_effects)
    distributions->add_compatible_effects(effect.effect);
  for (const distributions::RoundFinding& finding : comparison.findings) {
    v1::RepeatFinding* message = distributions->add_findings();
    message->set_kind(NameOf(finding.kind));
    message->set_p(finding.p_value);
    message->set_words(finding.words);
    *message->mutable_compatible_effects() = {finding.compatible.begin(), finding.compatible.end()};
    for (const std::string& effect : finding.compatible)
      if (std::count(distributions->compatible_effects().begin(), distributions->compatible_effects().end(),
                     effect) == 0)
        distributions->add_compatible_effects(effect);
  }
  for (const residuals::ComparedHistogram& histogram : comparison.histograms)
    WriteHistogram(histogram, report);
}

void WriteWarnings(const distributions::PoseFreeComparison& comparison, v1::Report* report) {
  report->add_warnings(
      "no poses: times are compared as distributions, which is about two orders weaker than touch by touch; "
      "where on the object the model fails, and which effect is missing, cannot be known");
  report->add_warnings(absl::StrCat("no poses: the set is supposed to be made like this: ", comparison.plan,
                                    "; another protocol or speed shows as a difference, too"));
  if (!comparison.noise_is_known)
    report->add_warnings(comparison.model_has_noise
                             ? "no rounds can be told apart: the noise is taken from the model as it is"
                             : "no rounds can be told apart and the model has no noise: nothing is known "
                               "about the noise, and its lack may be all that differs");
  if (comparison.size_ratio != 1)
    report->add_warnings(absl::StrCat("the measured times are ",
                                      absl::StrFormat("%.2g", comparison.size_ratio),
                                      " times the simulated ones: is their unit us, and the mesh's mm?"));
}

void WriteNoiseParameter(const distributions::RoundNoise& noise, v1::ParameterValue* value) {
  value->set_name("sigma_us");
  value->set_unit("us");
  value->set_value(noise.sigma_s * kMicrosecondsPerSecond);
  value->set_std_error(noise.std_error_s * kMicrosecondsPerSecond);
  value->set_lower(noise.lower_s * kMicrosecondsPerSecond);
  value->set_upper(noise.upper_s * kMicrosecondsPerSecond);
}

// The noise that the rounds show is known for certain, whatever else is wrong: a step or a refit. Returns the
// sentence about it.
std::string WriteNoiseChange(const distributions::PoseFreeComparison& comparison, v1::Report* report) {
  if (comparison.noise_change == distributions::NoiseChange::kNone) return "";
  report->set_improved_model_yaml(model::FormatModel(*comparison.model));
  report->set_improved_model_hash(comparison.model->Hash());
  const bool is_new = comparison.noise_change == distributions::NoiseChange::kNewEffect;
  const auto effect = effects::FindByRole(model::EffectRole::kNoiseLevel);
  if (is_new) {
    v1::Step* step = report->add_steps();
    step->set_effect(effect->name);
    step->set_probability(engine::kMaxProbability);
    step->set_scope("rig");
    step->set_lack_of_fit_p(comparison.p_value);
    step->set_meaning(effect->meaning);
    step->set_check_on_rig(effect->check_on_rig);
    step->set_remedy(effect->remedy);
    WriteNoiseParameter(*comparison.noise, step->add_parameters());
  } else {
    v1::Refit* refit = report->add_refitted();
    refit->set_effect(effect->name);
    WriteNoiseParameter(*comparison.noise, refit->add_parameters());
  }
  return absl::StrCat(
      "Rounds of the same poses scatter by ", TimeInWords(comparison.noise->sigma_s),
      is_new ? " per finger; the model has no noise. " : " per finger, not as the model says. ");
}

std::string CompatibleEffectsInWords(const std::vector<distributions::CompatibleEffect>& compatible) {
  std::vector<std::string> words;
  for (const distributions::CompatibleEffect& effect : compatible)
    words.push_back(absl::StrCat(effect.effect, " (", effect.values, ")"));
  if (words.empty())
    return "No single effect of the catalogue would make them alike: there may be several, or another "
           "protocol or speed. ";
  if (words.size() == 1)
    return absl::StrCat("The only compatible effect of the catalogue is ", words[0],
                        "; that is no proof: several at once, another protocol or speed may do the same. ");
  return absl::StrCat("Compatible effects are ", absl::StrJoin(words, ", "),
                      "; which of them it is, if it is one, times alone cannot tell. ");
}

void WriteDiagnosis(const distributions::PoseFreeComparison& comparison, v1::Report* report) {
  const std::string noise_words = WriteNoiseChange(comparison, report);
  report->mutable_final()->set_lack_of_fit_p(comparison.p_value);
  if (comparison.compatible && !comparison.findings.empty()) {
    report->set_verdict(v1::Report::UNEXPLAINED);
    report->set_summary(absl::StrCat(noise_words, FindingsInWords(comparison.findings),
                                     "As distributions, the times ", "do not differ from the model's ",
                                     PInWords(comparison),
                                     ". To know more, write down the poses of the touches."));
    return;
  }
  if (comparison.compatible) {
    report->set_verdict(comparison.noise_change == distributions::NoiseChange::kNewEffect
                            ? v1::Report::MISSING_EFFECTS
                            : v1::Report::ADEQUATE);
    report->set_summary(absl::StrCat(
        noise_words, "As distributions, the measured times and those of the model ",
        comparison.noise_change == distributions::NoiseChange::kNone ? "" : "with that noise ",
        "do not differ ", PInWords(comparison), ". That says little: without poses only large errors show."));
    return;
  }
  report->set_verdict(v1::Report::UNEXPLAINED);
  report->set_summary(absl::StrCat(noise_words, FindingsInWords(comparison.findings),
                                   "As distributions, the measured times differ from the model's ",
                                   PInWords(comparison), ". ",
                                   CompatibleEffectsInWords(comparison.compatible_effects),
                                   "To know more, write down the poses of the touches."));
}

}  // namespace

v1::Report PoseFreeReport(const DiagnosisInput& input, const distributions::PoseFreeComparison& comparison) {
  v1::Report report;
  report.set_model_name(input.model->name);
  report.set_model_hash(input.model->Hash());
  WriteRows(*input.set, comparison.rows, &report);
  if (comparison.noise) WriteNoiseFloor(*comparison.noise, &report);
  WriteTest(comparison, &report);
  WriteWarnings(comparison, &report);
  if (comparison.diagnosed) {
    WriteDiagnosis(comparison, &report);
  } else {
    report.set_summary(absl::StrCat("As distributions, the measured times ",
                                    comparison.compatible ? "do not differ" : "differ", " from the model's ",
                                    PInWords(comparison), "."));
  }
  return report;
}

}  // namespace touchstone::diagnosis::report
