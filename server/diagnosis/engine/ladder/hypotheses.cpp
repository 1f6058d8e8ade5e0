#include "server/diagnosis/engine/ladder/hypotheses.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <utility>

#include "server/base/status.h"

namespace touchstone::diagnosis::engine {

absl::Status Hypotheses::Ask(const Questions& questions) const {
  for (const HypothesisRule& rule : *rules_) {
    const auto question = questions.find(rule.hypothesis);
    if (question == questions.end() || !Allows(rule.hypothesis)) continue;
    TOUCHSTONE_RETURN_IF_ERROR(question->second());
  }
  return absl::OkStatus();
}

void Hypotheses::Add(int hypothesis, std::string words, Describe describe) {
  found_.push_back({&(*rules_)[static_cast<size_t>(hypothesis)], std::move(words), std::move(describe)});
}

template <typename Predicate>
bool Hypotheses::Any(Predicate predicate) const {
  return std::any_of(found_.begin(), found_.end(),
                     [&](const Found& found) { return predicate(*found.rule); });
}

bool Hypotheses::Has(int hypothesis) const {
  return Any([&](const HypothesisRule& rule) { return rule.hypothesis == hypothesis; });
}

bool Hypotheses::Allows(int hypothesis) const {
  return !Any([&](const HypothesisRule& rule) {
    return std::find(rule.excludes.begin(), rule.excludes.end(), hypothesis) != rule.excludes.end();
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
                   [](const Found* a, const Found* b) { return a->rule->said < b->rule->said; });
  std::string words;
  for (const Found* found : in_order) {
    absl::StrAppend(&words, words.empty() ? "" : " ", found->words);
    if (!found->rule->and_next) break;
  }
  return words;
}

void Hypotheses::DescribeRest(UnexplainedRest* rest) const {
  for (const Found& found : found_)
    if (found.describe) found.describe(rest);
  rest->words = Words();
}

}  // namespace touchstone::diagnosis::engine
