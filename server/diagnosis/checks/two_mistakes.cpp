#include "server/diagnosis/checks/two_mistakes.h"

#include <algorithm>
#include <memory>

#include "server/diagnosis/checks/mistakes.h"
#include "server/diagnosis/checks/rules.h"

namespace touchstone::diagnosis::checks {
namespace {

// What may stand beside any other mistake: columns, directions and units are mistakes of the program that wrote the
// file, the rest of whoever measured.
bool IsOfTheProgram(const Mistake& mistake) {
  const session::MeasurementFix& fix = mistake.fix;
  return !fix.finger_order.empty() || fix.reverse_approach || fix.reverse_lateral || fix.scale_times != 1;
}

}  // namespace

std::vector<Mistake> TwoMistakes(const DiagnosisInput& input, const std::vector<int>& rows,
                                 const TrialResult& before, ThreadPool* pool) {
  if (before.Relative({}) < kCheckRules.min_before_pair) return {};
  std::vector<Mistake> best;
  double least = INFINITY;
  for (const Mistake& first : MistakesOfFiles(input.set->fingers, before.speed_m_s)) {
    if (!IsOfTheProgram(first)) continue;
    auto set = std::make_shared<session::MeasurementSet>(*input.set);
    if (!session::ApplyFix(first.fix, set.get()).ok()) continue;
    DiagnosisInput once = input;
    once.set = set;
    const Trial trial(once, rows);
    const absl::StatusOr<TrialResult> now = trial.Run({});
    if (!now.ok() || now->objects.empty()) continue;
    std::vector<Mistake> mistakes = AllMistakes(trial, *now);
    // Two factors of one scale make any factor, and physics with it.
    if (ChangesScale(first))
      mistakes.erase(std::remove_if(mistakes.begin(), mistakes.end(), ChangesScale), mistakes.end());
    const std::vector<Tried> pairs = Convincing(TryAll(trial, mistakes, pool), *now);
    if (pairs.empty() || !(pairs[0].relative < least)) continue;
    const double was = std::min(before.Relative({}), kCheckRules.max_before.value());
    if (pairs[0].relative > kCheckRules.pair_stricter * kCheckRules.max_left ||
        pairs[0].relative > kCheckRules.pair_stricter * kCheckRules.max_ratio * was)
      continue;
    // The scale of both together must be the discrete one.
    Mistake both = first;
    both.fix.scale_times *= pairs[0].mistake.fix.scale_times;
    both.fix.scale_speed *= pairs[0].mistake.fix.scale_speed;
    if (!ScaleIsRight(both, pairs[0].after.scale, pairs[0].after.scale_error)) continue;
    least = pairs[0].relative;
    best = {first, pairs[0].mistake};
  }
  return best;
}

}  // namespace touchstone::diagnosis::checks
