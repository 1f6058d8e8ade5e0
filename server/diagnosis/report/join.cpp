#include "server/diagnosis/report/join.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "server/diagnosis/engine/search/candidates.h"
#include "server/diagnosis/report/message/message_parts.h"
#include "server/diagnosis/report/words/summary.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::report {
namespace {

using engine::Verdict;

std::string NameOf(Verdict verdict) {
  return v1::Report::Verdict_Name(ToMessage(verdict));
}

template <typename T>
void Append(std::vector<T>* list, std::vector<T> more) {
  list->insert(list->end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
}

std::vector<DataKind> KindsOf(const std::string& shown_by) {
  std::vector<DataKind> kinds;
  if (shown_by != "photographs") kinds.push_back(DataKind::kTouches);
  if (shown_by != "touches") kinds.push_back(DataKind::kPhotographs);
  return kinds;
}

std::string ErrorsInWords(const JointQuality& quality) {
  return absl::StrFormat("%.3g ms on touches and %.3g grey levels on photographs",
                         quality.touches.rmse / 1000, quality.photographs.rmse);
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
      "%.3g times as from photographs alone.",
      than_touches, than_photographs);
}

std::string ConflictInWords(const joint::Conflict& conflict) {
  return absl::StrFormat(
      "Touches and photographs contradict each other about %s: touches alone ask for %s, photographs alone "
      "for %s (chance would part them so far with p = %.1g). One value for both would explain neither: the "
      "object was moved between touching and photographing, or each kind has something else that its own "
      "data take for %s. Nothing is claimed.",
      conflict.effect, ValuesInWords(conflict.values[0]), ValuesInWords(conflict.values[1]),
      std::max(conflict.p, 1e-300), conflict.effect);
}

Step SharedStepOf(const joint::SharedStep& from) {
  Step step;
  step.effect = from.effect;
  step.equivalent = from.equivalent;
  step.probability = from.probability;
  step.parameters = from.parameters;
  step.gain_nats = from.gain_nats;
  step.scope = from.scope;
  step.model = from.model;
  step.shown_by = KindsOf(from.shown_by);
  step.words = from.words;
  if (step.shown_by.size() == 1)
    absl::StrAppend(&step.words, step.words.empty() ? "" : "; ", "only the ", from.shown_by, " show it");
  if (const auto effect = effects::Catalogue().Find(from.effect)) engine::AddTexts(*effect, &step);
  return step;
}

// Held-out errors of values that a part of the data gave.
Quality Unseen(Quality quality, const joint::SharedEffects& shared, DataKind kind) {
  const size_t index = kind == DataKind::kTouches ? 0 : 1;
  // Where either kind is too little for a shared effect none was looked for.
  if (index < shared.heldout.size()) quality.heldout_rmse = shared.heldout[index].Of(quality.heldout_rmse);
  return quality;
}

// What a shared effect would take the place of names it as its equivalent.
void AddUndecided(const joint::SharedEffects& shared, Step* step) {
  for (const joint::Undecided& undecided : shared.undecided) {
    const auto& replaced = undecided.in_place_of;
    if (std::find(replaced.begin(), replaced.end(), step->effect) == replaced.end()) continue;
    step->equivalent.push_back(undecided.effect);
    if (step->discriminating_measurement.empty())
      step->discriminating_measurement = engine::DiscriminatingMeasurement({step->effect, undecided.effect});
  }
}

// Shared steps, then each kind's own with what the other kind has beside them.
void AddSteps(const JointParts& parts, Diagnosis* both) {
  JointQuality so_far = parts.initial;
  const auto add = [&](Step step) {
    both->steps.push_back(std::move(step));
    both->data[0].after_step.push_back(so_far.touches);
    both->data[1].after_step.push_back(so_far.photographs);
  };
  for (size_t i = 0; i < parts.shared.steps.size(); ++i) {
    const joint::SharedStep& step = parts.shared.steps[i];
    so_far = {Unseen(parts.shared_quality[i].touches, parts.shared, DataKind::kTouches),
              Unseen(parts.shared_quality[i].photographs, parts.shared, DataKind::kPhotographs)};
    if (step.given)
      both->refitted.push_back({step.effect, step.parameters});
    else
      add(SharedStepOf(step));
  }
  const auto add_own = [&](const Diagnosis& own, Quality* quality) {
    const DataReport& data = own.data[0];
    for (size_t i = 0; i < own.steps.size(); ++i) {
      *quality = Unseen(data.after_step[i], parts.shared, data.kind);
      Step step = own.steps[i];
      step.shown_by = {data.kind};
      AddUndecided(parts.shared, &step);
      add(std::move(step));
    }
  };
  add_own(parts.touches, &so_far.touches);
  if (both->data[0].final) so_far.touches = *both->data[0].final;
  add_own(parts.photographs, &so_far.photographs);
}

// One paragraph: what both show together, then each kind.
std::string SummarizeJointly(const JointParts& parts) {
  std::vector<std::string> sentences = {
      absl::StrCat("The model is off by ", ErrorsInWords(parts.initial), ".")};
  for (const joint::Conflict& conflict : parts.shared.conflicts)
    sentences.push_back(ConflictInWords(conflict));
  std::vector<std::string> in_place;
  for (const joint::SharedStep& step : parts.shared.steps) {
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
  for (const joint::Undecided& undecided : parts.shared.undecided)
    sentences.push_back(absl::StrCat("One cause, ", undecided.effect, ", explains both as well as ",
                                     absl::StrJoin(undecided.in_place_of, " and "), "."));
  // A conflict is the verdict of both: what each would say by itself would contradict it.
  if (!parts.shared.conflicts.empty()) return absl::StrJoin(sentences, " ");
  // The verdicts named here are those that hold with the shared effects in place, as the words after them do.
  const bool shared = !in_place.empty();
  const std::string place =
      shared ? absl::StrCat(", with ", absl::StrJoin(in_place, " and "), " in place") : "";
  for (const auto& [name, own] :
       {std::pair{"Touches", &parts.touches}, std::pair{"Photographs", &parts.photographs}})
    sentences.push_back(
        absl::StrCat(name, " (", NameOf(own->verdict), place, "): ", Summarize(*own, shared)));
  return absl::StrJoin(sentences, " ");
}

// A conflict is worse than what a named effect explains.
Verdict VerdictOf(const JointParts& parts) {
  const Verdict verdict = WorseOf(parts.touches.verdict, parts.photographs.verdict);
  const auto& steps = parts.shared.steps;
  const auto any = [&](bool given) {
    return std::any_of(steps.begin(), steps.end(), [&](const auto& step) { return step.given == given; });
  };
  return WorseOf(verdict, engine::VerdictOf(!parts.shared.conflicts.empty(), any(false), any(true)));
}

}  // namespace

Verdict WorseOf(Verdict one, Verdict other) {
  constexpr Verdict kWorseLater[] = {Verdict::kNone,           Verdict::kAdequate,    Verdict::kWrongValues,
                                     Verdict::kMissingEffects, Verdict::kUnexplained, Verdict::kTooLittleData,
                                     Verdict::kCheckData};
  const auto rank = [&](Verdict v) { return std::find(std::begin(kWorseLater), std::end(kWorseLater), v); };
  return rank(one) >= rank(other) ? one : other;
}

Diagnosis SideBySide(Diagnosis touches, Diagnosis photographs) {
  Diagnosis both = std::move(touches);
  // One of touches alone is none of a model that photographs have a part in.
  both.posterior.reset();
  SetNothingMissing(std::nullopt, &both);
  both.uncertainty.clear();
  both.verdict = WorseOf(both.verdict, photographs.verdict);
  both.model_name = photographs.model_name;
  both.model_hash = photographs.model_hash;
  for (DataProblem& problem : photographs.data_problems) problem.data_index = 1;
  Append(&both.data, std::move(photographs.data));
  Append(&both.refitted, std::move(photographs.refitted));
  Append(&both.confounded, std::move(photographs.confounded));
  Append(&both.superfluous, std::move(photographs.superfluous));
  Append(&both.data_problems, std::move(photographs.data_problems));
  Append(&both.next, std::move(photographs.next));
  Append(&both.warnings, std::move(photographs.warnings));
  both.summary = absl::StrCat("Touches: ", both.summary, " Photographs: ", photographs.summary);
  both.duration_s += photographs.duration_s;
  return both;
}

Diagnosis Join(JointParts parts) {
  Diagnosis both = SideBySide(parts.touches, parts.photographs);
  both.model_name = parts.model_name;
  both.model_hash = parts.model_hash;
  both.verdict = VerdictOf(parts);
  SetNothingMissing(parts.nothing_missing, &both);
  both.steps.clear();
  for (DataReport& data : both.data) {
    data.after_step.clear();
    data.initial = data.kind == DataKind::kTouches ? parts.initial.touches : parts.initial.photographs;
    if (data.final) data.final = Unseen(*data.final, parts.shared, data.kind);
    if (data.noise_floor) data.reducible_share = ReducibleShare(*data.noise_floor, data.initial->rmse);
  }
  AddSteps(parts, &both);
  for (const joint::Conflict& conflict : parts.shared.conflicts)
    for (DataReport& data : both.data) {
      if (!data.unexplained) data.unexplained.emplace();
      absl::StrAppend(&data.unexplained->words, data.unexplained->words.empty() ? "" : " ",
                      ConflictInWords(conflict));
    }
  both.summary = SummarizeJointly(parts);
  return both;
}

}  // namespace touchstone::diagnosis::report
