#include "server/diagnosis/selection/ladder/doubts.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "server/base/numbers/decompositions.h"
#include "server/base/numbers/distributions.h"
#include "server/diagnosis/engine/fit/resampled_covariance.h"
#include "server/diagnosis/engine/ladder/rules.h"
#include "server/diagnosis/selection/ladder/rules.h"
#include "server/diagnosis/selection/session/session_order.h"

namespace touchstone::diagnosis::selection {
namespace {

// The largest value of the effect over the size that rigs show.
double SizeOverTypical(const engine::Fit& fit, int index) {
  double largest = 0;
  for (int i = 0; i < fit.model.size(); ++i) {
    const engine::FreeParameter& p = fit.model.parameters()[i];
    if (p.effect == index) largest = std::max(largest, std::abs(fit.point[i] - p.neutral) / p.scale);
  }
  return largest;
}

// "14 mm", where a value of the step is beyond what rigs show, and the limit; empty: none is.
std::string UnusualValue(const model::Effect& effect, const engine::LadderStep& step) {
  const engine::ParameterEstimate* farthest = nullptr;
  double most = 1, limit = 0;
  for (const engine::ParameterEstimate& e : step.parameters)
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

// Says `words` of the steps of this effect, which are at most as probable as `most`.
void Doubt(const std::string& effect, const std::string& words, double most, Ladder* ladder) {
  for (engine::LadderStep& step : ladder->steps) {
    if (step.effect != effect) continue;
    engine::AddWords(words, &step);
    step.probability = std::min(step.probability, most);
  }
}

}  // namespace

void DoubtUnusualValues(const engine::Fit& fit, const std::vector<engine::SelectedStep>& steps,
                        Ladder* ladder) {
  for (const engine::SelectedStep& selected : steps) {
    const model::Effect& effect = *fit.model.base().effects[selected.effect].effect;
    for (engine::LadderStep& step : ladder->steps) {
      if (step.effect != engine::NameOf(effect)) continue;
      const std::string words = UnusualValue(effect, step);
      if (words.empty()) continue;
      engine::AddWords(words, &step);
      step.probability = std::min(step.probability, kLadderRules.max_unusual.value());
    }
  }
}

std::string StrangeValuesInWords(const engine::Fit& fit, const std::vector<engine::SelectedStep>& steps,
                                 Ladder* ladder) {
  int effects = 0, near_typical = 0;
  std::vector<std::string> stopped;
  for (const engine::SelectedStep& selected : steps) {
    ++effects;
    near_typical += SizeOverTypical(fit, selected.effect) <= kLadderRules.near_typical;
    if (!engine::IsAtBound(fit, selected.effect)) continue;
    const std::string name = engine::NameOf(*fit.model.base().effects[selected.effect].effect);
    stopped.push_back(name);
    for (engine::LadderStep& step : ladder->steps)
      if (step.effect == name)
        engine::AddWords("The value is at the catalogue's bound: the data ask for one beyond it.", &step);
  }
  if (!stopped.empty())
    return absl::StrCat("The data ask for more of ", absl::StrJoin(stopped, ", "),
                        " than the catalogue allows: a value at its bound explains nothing.");
  if (effects > kLadderRules.many_effects && near_typical == 0)
    return absl::StrCat("It would take ", effects,
                        " effects at once, none near the size that rigs show: something else is wrong.");
  return "";
}

void DoubtTwoSpeeds(const Workspace& workspace, const engine::Fit& fit,
                    const std::vector<engine::SelectedStep>& steps, Ladder* ladder) {
  // The touch of each row of the search.
  std::vector<int> touches;
  for (const int t : workspace.contrasts->touch_of_row())
    touches.push_back(workspace.contrasts->touches()[t]);
  const auto name_of = [&](size_t step) {
    return engine::NameOf(*fit.model.base().effects[steps[step].effect].effect);
  };
  for (const auto& [one, other] : PairsAtTwoSpeeds(*workspace.searched, touches, fit, steps)) {
    const std::string names[] = {name_of(one), name_of(other)};
    for (const std::string& name : std::set<std::string>{names[0], names[1]})
      Doubt(name,
            absl::StrCat("At two speeds, whatever depends on the speed is some sum of ", names[0], " and ",
                         names[1], ": measure at a third one."),
            kLadderRules.max_beside_other, ladder);
  }
}

void DoubtCarriedByFewPoses(const Workspace& workspace, const engine::Fit& fit,
                            const std::vector<engine::SelectedStep>& steps, Ladder* ladder) {
  const Eigen::MatrixXd covariance =
      engine::ResampledCovariance(workspace.experiment, fit, workspace.input.seed);
  for (const engine::SelectedStep& selected : steps) {
    std::vector<int> members;
    for (int i = 0; i < fit.model.size(); ++i)
      if (fit.model.parameters()[i].effect == selected.effect) members.push_back(i);
    const int size = static_cast<int>(members.size());
    if (size == 0) continue;
    Eigen::MatrixXd own(size, size);
    Eigen::VectorXd from_none(size);
    for (int a = 0; a < size; ++a) {
      from_none[a] = fit.point[members[a]] - fit.model.parameters()[members[a]].neutral;
      for (int b = 0; b < size; ++b) own(a, b) = covariance(members[a], members[b]);
    }
    const double p = ChiSquaredTail(from_none.dot(SymmetricSolver(own).Solve(from_none)), size);
    if (p < kLadderRules.few_poses_p) continue;
    Doubt(engine::NameOf(*fit.model.base().effects[selected.effect].effect),
          "A few poses carry it: other poses may not show it.", engine::kLadderRules.doubted, ladder);
  }
}

}  // namespace touchstone::diagnosis::selection
