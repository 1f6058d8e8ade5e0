#include "server/diagnosis/selection/doubts.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

namespace touchstone::diagnosis::selection {
namespace {

constexpr int kManyEffects = 3;         // more at once need a reason
constexpr double kNearTypical = 5;      // sizes over the typical one that are near it
constexpr double kDoubtful = 0.5;       // probability of a step at its bound, or of one among many
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

}  // namespace

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
        step.words = "The value is at the catalogue's bound: the data ask for one beyond it.";
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
    if (step.words.empty())
      step.words = "Beside it a rest remains unexplained: it may stand in for something else.";
  }
  for (RankedCandidate& candidate : ladder->candidates)
    candidate.probability = std::min(candidate.probability, most);
}

}  // namespace touchstone::diagnosis::selection
