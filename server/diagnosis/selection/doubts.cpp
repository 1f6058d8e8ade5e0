#include "server/diagnosis/selection/doubts.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

namespace touchstone::diagnosis::selection {
namespace {

constexpr int kManyEffects = 3;         // more at once need a reason
constexpr double kNearTypical = 5;      // sizes over the typical one that are near it
constexpr double kDoubtful = 0.5;       // probability of a step at its bound, or of one among many
constexpr double kMaxUnusual = 0.9;     // ... of one that would be larger than rigs show
constexpr double kMaxBesideRest = 0.9;  // ... of one beside a rest, where it explains all but a trace

// The largest value of the effect over the size that rigs show.
double SizeOverTypical(const inference::Fit& fit, int index) {
  double largest = 0;
  for (int i = 0; i < fit.model.size(); ++i) {
    const inference::FreeParameter& p = fit.model.parameters()[i];
    if (p.effect == index) largest = std::max(largest, std::abs(fit.point[i] - p.neutral) / p.scale);
  }
  return largest;
}

// "14 mm", where a value of the step is beyond what rigs show, and the limit; empty: none is.
std::string UnusualValue(const model::Effect& effect, const LadderStep& step) {
  const inference::ParameterEstimate* farthest = nullptr;
  double most = 1, limit = 0;
  for (const inference::ParameterEstimate& e : step.parameters)
    for (const model::ParameterInfo& p : effect.parameters) {
      const double usual = e.value < 0 ? p.usual_lower : p.usual_upper;
      if (p.name != e.name || !std::isfinite(usual) || usual == 0 || e.value / usual <= most) continue;
      farthest = &e;
      most = e.value / usual;
      limit = std::abs(usual);
    }
  if (farthest == nullptr) return "";
  return absl::StrFormat(
      "Would need %.3g %s, more than rigs show (up to %.3g %s): look for a mistake in the set-up.",
      farthest->value, farthest->unit, limit, farthest->unit);
}

void AddWords(const std::string& words, LadderStep* step) {
  absl::StrAppend(&step->words, step->words.empty() ? "" : " ", words);
}

}  // namespace

void DoubtUnusualValues(const inference::Fit& fit, const SelectionResult& selection, Ladder* ladder) {
  for (const SelectedStep& selected : selection.steps) {
    const model::Effect& effect = *fit.model.base().effects[selected.effect].effect;
    for (LadderStep& step : ladder->steps) {
      if (step.effect != inference::NameOf(effect)) continue;
      const std::string words = UnusualValue(effect, step);
      if (words.empty()) continue;
      AddWords(words, &step);
      step.probability = std::min(step.probability, kMaxUnusual);
    }
  }
}

Doubts DoubtsOf(const inference::Fit& fit, const SelectionResult& selection, Ladder* ladder) {
  Doubts doubts;
  int effects = 0, near_typical = 0;
  std::vector<std::string> stopped;
  for (const SelectedStep& selected : selection.steps) {
    ++effects;
    near_typical += SizeOverTypical(fit, selected.effect) <= kNearTypical;
    if (!IsAtBound(fit, selected.effect)) continue;
    const std::string name = inference::NameOf(*fit.model.base().effects[selected.effect].effect);
    stopped.push_back(name);
    for (LadderStep& step : ladder->steps)
      if (step.effect == name)
        AddWords("The value is at the catalogue's bound: the data ask for one beyond it.", &step);
  }
  doubts.at_bound = !stopped.empty();
  doubts.many_strange = effects > kManyEffects && near_typical == 0;
  if (doubts.at_bound)
    doubts.words = absl::StrCat("The data ask for more of ", absl::StrJoin(stopped, ", "),
                                " than the catalogue allows: a value at its bound explains nothing.");
  else if (doubts.many_strange)
    doubts.words =
        absl::StrCat("It would take ", effects,
                     " effects at once, none near the size that rigs show: something else is wrong.");
  return doubts;
}

void Doubt(double explained, const Doubts& doubts, Ladder* ladder) {
  const double most = doubts.any() ? kDoubtful : kDoubtful + (kMaxBesideRest - kDoubtful) * explained;
  for (LadderStep& step : ladder->steps) {
    step.probability = std::min(step.probability, most);
    AddWords("Beside it a rest remains unexplained: it may stand in for something else.", &step);
  }
  for (RankedCandidate& candidate : ladder->candidates)
    candidate.probability = std::min(candidate.probability, most);
}

}  // namespace touchstone::diagnosis::selection
