#include "server/diagnosis/report/write_joint_report.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/diagnosis/report/message_parts.h"
#include "server/diagnosis/report/photograph_summary.h"
#include "server/diagnosis/report/summary.h"
#include "server/diagnosis/report/write_photograph_report.h"
#include "server/diagnosis/report/write_report.h"
#include "server/diagnosis/selection/candidates.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::report {
namespace {

using engine::Verdict;

// Worse ones later.
int RankOf(Verdict verdict) {
  switch (verdict) {
    case Verdict::kNone:
      return 0;
    case Verdict::kAdequate:
      return 1;
    case Verdict::kWrongValues:
      return 2;
    case Verdict::kMissingEffects:
      return 3;
    case Verdict::kUnexplained:
      return 4;
    case Verdict::kTooLittleData:
      return 5;
    case Verdict::kCheckData:
      return 6;
  }
  return 0;
}

// A conflict is worse than what a named effect explains.
Verdict WorseOf(Verdict one, Verdict other) {
  return RankOf(one) >= RankOf(other) ? one : other;
}

Verdict WithShared(const JointDiagnosis& diagnosis, const char* kind, Verdict own) {
  if (!diagnosis.shared.conflicts.empty()) return WorseOf(own, Verdict::kUnexplained);
  for (const joint::SharedStep& step : diagnosis.shared.steps)
    if (step.shown_by == "both" || step.shown_by == kind)
      own = WorseOf(own, step.given ? Verdict::kWrongValues : Verdict::kMissingEffects);
  return own;
}

std::string NameOf(Verdict verdict) {
  return v1::Report::Verdict_Name(ToMessage(verdict));
}

std::string ErrorsInWords(const JointQuality& quality) {
  return absl::StrFormat("%.3g ms on touches and %.3g grey levels on photographs",
                         Microseconds(quality.touches.rmse) / 1000, quality.photographs.rmse);
}

// Of a mean square error, what is not noise.
double ShareBeyond(double rmse, double floor) {
  return rmse > floor ? 1 - floor * floor / (rmse * rmse) : 0;
}

// Of the value that gains most by the other kind.
std::string TighterInWords(const joint::SharedStep& step) {
  double than_touches = 0, than_photographs = 0;
  for (const engine::ParameterEstimate& e : step.parameters) {
    if (!(e.std_error > 0)) continue;
    for (const auto& [kind, std_error] : e.std_error_alone) {
      double& than = kind == "touches" ? than_touches : than_photographs;
      than = std::max(than, std_error / e.std_error);
    }
  }
  if (!(than_touches > 0) || !(than_photographs > 0)) return "";
  return absl::StrFormat(
      " Fitted to both together its values are up to %.3g times as sure as from touches alone, and up to "
      "%.3g times as "
      "from photographs alone.",
      than_touches, than_photographs);
}

std::string ConflictInWords(const joint::Conflict& conflict) {
  return absl::StrFormat(
      "Touches and photographs contradict each other about %s: touches alone ask for %s, photographs alone "
      "for %s (chance "
      "would part them so far with p = %.1g). One value for both would explain neither: the object was moved "
      "between "
      "touching and photographing, or each kind has something else that its own data take for %s. Nothing is "
      "claimed.",
      conflict.effect, ValuesInWords(conflict.values[0]), ValuesInWords(conflict.values[1]),
      std::max(conflict.p, 1e-300), conflict.effect);
}

void WriteSharedStep(const joint::SharedStep& step, const JointQuality& quality, v1::Step* message) {
  message->set_effect(step.effect);
  for (const std::string& name : step.equivalent) message->add_equivalent(name);
  message->set_probability(step.probability);
  WriteParameters(step.parameters, message);
  message->set_rmse_us(Microseconds(quality.touches.rmse));
  message->set_heldout_rmse_us(Microseconds(quality.touches.heldout_rmse));
  message->set_rmse_grey(quality.photographs.rmse);
  message->set_heldout_rmse_grey(quality.photographs.heldout_rmse);
  message->set_lack_of_fit_p(std::min(quality.touches.lack_of_fit_p, quality.photographs.lack_of_fit_p));
  message->set_shown_by(step.shown_by);
  message->set_gain_nats(step.gain_nats);
  message->set_scope(ToMessage(step.scope));
  std::string words = step.words;
  if (step.shown_by != "both")
    absl::StrAppend(&words, words.empty() ? "" : "; ", "only the ", step.shown_by, " show it");
  message->set_words(words);
  if (const auto effect = effects::Catalogue().Find(step.effect)) {
    message->set_meaning(effect->meaning);
    message->set_check_on_rig(effect->check_on_rig);
    message->set_remedy(effect->remedy);
  }
}

// What one kind says of a rest beside what the other says.
void MergeUnexplained(const v1::Unexplained& touches, const v1::Unexplained& photographs,
                      v1::Unexplained* both) {
  *both = touches;
  for (const v1::CovariateTest& test : photographs.covariates()) *both->add_covariates() = test;
  both->set_rmse_grey(photographs.rmse_grey());
  both->set_heldout_rmse_grey(photographs.heldout_rmse_grey());
  if (both->formula_yaml().empty() && both->lookup_yaml().empty()) {
    both->set_formula(photographs.formula());
    both->set_formula_yaml(photographs.formula_yaml());
    both->set_lookup_yaml(photographs.lookup_yaml());
    both->set_heldout_gain(photographs.heldout_gain());
  }
  both->set_words(
      absl::StrCat("Touches: ", touches.words().empty() ? "a rest remains." : touches.words(),
                   " Photographs: ", photographs.words().empty() ? "a rest remains." : photographs.words()));
}

void WriteInitialAndFinal(const JointDiagnosis& d, v1::Report* report) {
  v1::Quality* initial = report->mutable_initial();
  initial->set_rmse_us(Microseconds(d.initial.touches.rmse));
  initial->set_heldout_rmse_us(Microseconds(d.initial.touches.heldout_rmse));
  initial->set_rmse_grey(d.initial.photographs.rmse);
  initial->set_heldout_rmse_grey(d.initial.photographs.heldout_rmse);
  initial->set_lack_of_fit_p(std::min(d.initial.touches.lack_of_fit_p, d.initial.photographs.lack_of_fit_p));
  v1::Quality* final = report->mutable_final();
  if (d.touches.final) {
    final->set_rmse_us(Microseconds(d.touches.final->rmse));
    final->set_heldout_rmse_us(Microseconds(d.shared.heldout[0].Of(d.touches.final->heldout_rmse)));
  }
  if (d.photographs.final) {
    final->set_rmse_grey(d.photographs.final->rmse);
    final->set_heldout_rmse_grey(d.shared.heldout[1].Of(d.photographs.final->heldout_rmse));
  }
  if (d.touches.final && d.photographs.final)
    final->set_lack_of_fit_p(std::min(d.touches.final->lack_of_fit_p, d.photographs.final->lack_of_fit_p));
}

// Names what a shared effect would take the place of as its equivalent.
void AddUndecided(const JointDiagnosis& d, v1::Step* step) {
  for (const joint::Undecided& undecided : d.shared.undecided)
    if (std::find(undecided.in_place_of.begin(), undecided.in_place_of.end(), step->effect()) !=
        undecided.in_place_of.end()) {
      step->add_equivalent(undecided.effect);
      if (step->discriminating_measurement().empty())
        step->set_discriminating_measurement(
            engine::DiscriminatingMeasurement({step->effect(), undecided.effect}));
    }
}

// Shared steps, then each kind's own with what the other kind has beside them.
void WriteSteps(const JointDiagnosis& d, const std::vector<v1::Step>& touches,
                const std::vector<v1::Step>& photographs, v1::Report* report) {
  report->clear_steps();
  JointQuality so_far = d.initial;
  for (size_t i = 0; i < d.shared.steps.size(); ++i) {
    so_far = d.shared_quality[i];
    if (d.shared.steps[i].given) {
      v1::Refit* refit = report->add_refitted();
      refit->set_effect(d.shared.steps[i].effect);
      WriteParameters(d.shared.steps[i].parameters, refit);
    } else {
      WriteSharedStep(d.shared.steps[i], so_far, report->add_steps());
    }
  }
  for (const v1::Step& step : touches) {
    v1::Step* message = report->add_steps();
    *message = step;
    message->set_shown_by("touches");
    AddUndecided(d, message);
    message->set_heldout_rmse_us(d.shared.heldout[0].Of(step.heldout_rmse_us()));
    message->set_rmse_grey(so_far.photographs.rmse);
    message->set_heldout_rmse_grey(so_far.photographs.heldout_rmse);
  }
  for (const v1::Step& step : photographs) {
    v1::Step* message = report->add_steps();
    *message = step;
    message->set_shown_by("photographs");
    AddUndecided(d, message);
    message->set_heldout_rmse_grey(d.shared.heldout[1].Of(step.heldout_rmse_grey()));
    message->set_rmse_us(report->final().rmse_us());
    message->set_heldout_rmse_us(report->final().heldout_rmse_us());
  }
}

// The verdict of one kind of data, counting the shared effects that it shows.
Verdict VerdictOfTouches(const JointDiagnosis& diagnosis) {
  return WithShared(diagnosis, "touches", diagnosis.touches.verdict);
}

Verdict VerdictOfPhotographs(const JointDiagnosis& diagnosis) {
  return WithShared(diagnosis, "photographs", diagnosis.photographs.verdict);
}

}  // namespace

std::string SummarizeJointly(const JointDiagnosis& d) {
  std::vector<std::string> sentences = {absl::StrCat("The model is off by ", ErrorsInWords(d.initial), ".")};
  for (const joint::Conflict& conflict : d.shared.conflicts) sentences.push_back(ConflictInWords(conflict));
  std::vector<std::string> in_place;
  for (const joint::SharedStep& step : d.shared.steps) {
    in_place.push_back(step.effect);
    std::string name = step.effect;
    for (const std::string& other : step.equivalent) absl::StrAppend(&name, " or ", other);
    sentences.push_back(
        absl::StrCat(step.given ? "In the model another value: " : "Missing: ", name, " (",
                     ValuesInWords(step.parameters), step.words.empty() ? "" : ", ", step.words, "), ",
                     step.shown_by == "both" ? "which touches and photographs show alike."
                                             : absl::StrCat("which only the ", step.shown_by, " show."),
                     TighterInWords(step)));
  }
  for (const joint::Undecided& undecided : d.shared.undecided)
    sentences.push_back(absl::StrCat("One cause, ", undecided.effect, ", explains both as well as ",
                                     absl::StrJoin(undecided.in_place_of, " and "), "."));
  const std::string place =
      in_place.empty() ? "" : absl::StrCat(", with ", absl::StrJoin(in_place, " and "), " in place");
  // A conflict is the verdict of both: what each would say by itself would contradict it.
  // The verdicts named here are those that hold with the shared effects in place, as the words after them do.
  if (d.shared.conflicts.empty()) {
    const bool shared = !in_place.empty();
    sentences.push_back(
        absl::StrCat("Touches (", NameOf(d.touches.verdict), place, "): ", Summarize(d.touches, shared)));
    sentences.push_back(absl::StrCat("Photographs (", NameOf(d.photographs.verdict), place,
                                     "): ", Summarize(d.photographs, shared)));
  }
  return absl::StrJoin(sentences, " ");
}

v1::Report ToJointReport(const JointDiagnosis& d, const session::ImageSet& set) {
  v1::Report report = ToReport(d.touches);
  const std::vector<v1::Step> of_touches(report.steps().begin(), report.steps().end());
  const v1::Unexplained rest_of_touches = report.unexplained();
  const bool rest = report.has_unexplained();
  const uint32_t touches_needed = report.touches_needed();
  report.clear_steps();
  report.clear_unexplained();
  WritePhotographs(d.photographs, set, &report);
  const std::vector<v1::Step> of_photographs(report.steps().begin(), report.steps().end());
  if (rest) {
    const v1::Unexplained rest_of_photographs = report.unexplained();
    if (report.has_unexplained())
      MergeUnexplained(rest_of_touches, rest_of_photographs, report.mutable_unexplained());
    else
      *report.mutable_unexplained() = rest_of_touches;
  }
  for (const joint::Conflict& conflict : d.shared.conflicts) {
    v1::Unexplained* unexplained = report.mutable_unexplained();
    unexplained->set_words(absl::StrCat(unexplained->words(), unexplained->words().empty() ? "" : " ",
                                        ConflictInWords(conflict)));
  }
  WriteInitialAndFinal(d, &report);
  WriteSteps(d, of_touches, of_photographs, &report);
  report.set_model_name(d.model_name);
  report.set_model_hash(d.model_hash);
  report.set_improved_model_yaml(d.improved_model_yaml);
  report.set_improved_model_hash(d.improved_model_hash);
  report.set_verdict(ToMessage(WorseOf(VerdictOfTouches(d), VerdictOfPhotographs(d))));
  report.set_touches_needed(std::max(touches_needed, report.touches_needed()));
  report.set_reducible_share(std::max(
      ShareBeyond(d.initial.photographs.rmse, d.photographs.noise_floor.sigma),
      ShareBeyond(d.initial.touches.rmse, d.touches.noise_floor ? d.touches.noise_floor->sigma : 0)));
  report.set_summary(SummarizeJointly(d));
  report.set_duration_s(d.touches.duration_s + d.photographs.duration_s);
  return report;
}

}  // namespace touchstone::diagnosis::report
