#include "server/diagnosis/selection/ladder/hypotheses.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <utility>

namespace touchstone::diagnosis::selection {

const std::vector<HypothesisRule>& HypothesisRules() {
  using H = Hypothesis;
  using L = Leaves;
  using Q = Question;
  // Under correlated noise repeats are alike by chance: tests of their scatter do not hold.
  const std::vector<Question> of_scatter = {Q::kRounds,       Q::kSurface, Q::kPoseScatter, Q::kUnevenScatter,
                                            Q::kAbsentMemory, Q::kCourse,  Q::kMisfit};
  static const auto& rules = *new std::vector<HypothesisRule>{
      {H::kGroup, "group", L::kMeans, {}},
      // Touches with and without the offset make bumps, rounds and tails of every kind.
      {H::kPartialOffset,
       "partial offset",
       L::kMeans,
       {Q::kRounds, Q::kSurface, Q::kPoseScatter, Q::kNoise, Q::kUnevenScatter}},
      {H::kRandomWalk, "random walk", L::kMeans, of_scatter},
      {H::kCorrelatedNoise, "correlated noise", L::kNothing, of_scatter},
      // A curve of time looks like rounds, and any curve like bumps.
      {H::kCurve, "curve", L::kMeans, {Q::kRounds, Q::kSurface}},
      {H::kFormula, "formula", L::kMeans, {Q::kMisfit}},
      {H::kUnplaced, "unplaced misfit", L::kMeans, {}},
      // What scatters where the object lay elsewhere in every round is no property of the sensor.
      {H::kRemounted,
       "remounted",
       L::kDoubts,
       {Q::kSurface, Q::kPoseScatter, Q::kNoise, Q::kUnevenScatter, Q::kAbsentMemory}},
      {H::kStrangeValues, "strange values", L::kDoubts, {Q::kSurface}},
      {H::kUnevenScatter, "uneven scatter", L::kScatter, {}},
      {H::kRandomDelay, "random delay", L::kScatter, {}},
      {H::kLopsided, "lopsided scatter", L::kScatter, {}},
      {H::kSetAside, "set aside", L::kMeans, {}},
      {H::kTicks, "ticks", L::kMeans, {}},
      {H::kPlay, "play", L::kMeans, {Q::kNoise, Q::kUnevenScatter}},
      // Parts of a session that share a course scatter differently for that reason.
      {H::kCourse, "course", L::kMeans, {Q::kUnevenScatter}},
      {H::kMisfit, "misfit", L::kMeans, {}},
  };
  return rules;
}

void Hypotheses::Add(Hypothesis hypothesis, std::string words, NameFirst name_first) {
  const HypothesisRule& rule = HypothesisRules()[static_cast<size_t>(hypothesis)];
  found_.push_back({&rule, std::move(words), std::move(name_first)});
}

template <typename Predicate>
bool Hypotheses::Any(Predicate predicate) const {
  return std::any_of(found_.begin(), found_.end(),
                     [&](const Found& found) { return predicate(*found.rule); });
}

bool Hypotheses::Has(Hypothesis hypothesis) const {
  return Any([&](const HypothesisRule& rule) { return rule.hypothesis == hypothesis; });
}

bool Hypotheses::Allows(Question question) const {
  return !Any([&](const HypothesisRule& rule) {
    return std::find(rule.excludes.begin(), rule.excludes.end(), question) != rule.excludes.end();
  });
}

bool Hypotheses::Leave(Leaves least) const {
  return Any([&](const HypothesisRule& rule) { return rule.leaves >= least; });
}

std::string Hypotheses::Words() const {
  std::vector<const Found*> in_order;
  for (const Found& found : found_)
    if (!found.words.empty()) in_order.push_back(&found);
  std::stable_sort(in_order.begin(), in_order.end(),
                   [](const Found* a, const Found* b) { return a->rule->hypothesis < b->rule->hypothesis; });
  std::string words;
  for (const Found* found : in_order) {
    absl::StrAppend(&words, words.empty() ? "" : " ", found->words);
    if (found->rule->hypothesis != Hypothesis::kCurve) break;
  }
  return words;
}

void Hypotheses::NameCovariates(engine::UnexplainedRest* rest) const {
  for (const Found& found : found_)
    if (found.name_first) found.name_first(rest);
}

}  // namespace touchstone::diagnosis::selection
