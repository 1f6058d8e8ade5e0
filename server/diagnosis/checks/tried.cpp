#include "server/diagnosis/checks/tried.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/diagnosis/checks/object_mistakes.h"
#include "server/diagnosis/checks/rules.h"

namespace touchstone::diagnosis::checks {
namespace {

double RatioOf(const Tried& tried, const TrialResult& before) {
  const std::vector<std::string>& names = tried.mistake.objects;
  const double was = std::min(before.Relative(names), kCheckRules.max_before.value());
  return was > 0 ? tried.after.Relative(names) / was : 1;
}

bool Claimable(const Tried& tried, const TrialResult& before) {
  const std::vector<std::string>& names = tried.mistake.objects;
  if (!(RatioOf(tried, before) <= kCheckRules.max_ratio) ||
      !(tried.after.Relative(names) <= kCheckRules.max_left))
    return false;
  if (!ScaleIsRight(tried.mistake, tried.after.scale, tried.after.scale_error)) return false;
  return ChangesScale(tried.mistake) || before.ErrorM(names) >= kCheckRules.min_misfit_m;
}

}  // namespace

bool ScaleIsRight(const Mistake& mistake, double scale, double scale_error) {
  const double factor = mistake.fix.scale_times * mistake.fix.scale_speed;
  if (factor == 1) return true;
  const bool far = factor > 9 || factor < 1 / 9.0;
  return std::abs(scale - 1) <=
         (far ? kCheckRules.far_scale_tolerance.value() : kCheckRules.scale_tolerance.value()) +
             3 * scale_error;
}

bool ChangesScale(const Mistake& mistake) {
  return mistake.fix.scale_times != 1 || mistake.fix.scale_speed != 1;
}

std::vector<Tried> Convincing(const std::vector<Tried>& tried, const TrialResult& before) {
  const auto least = std::min_element(tried.begin(), tried.end(),
                                      [](const Tried& a, const Tried& b) { return a.relative < b.relative; });
  if (least == tried.end() || !Claimable(*least, before)) return {};
  std::vector<Tried> best;
  double next = INFINITY;
  const auto same_kind = [&](const Tried& one) {
    return std::any_of(best.begin(), best.end(),
                       [&](const Tried& other) { return other.mistake.kind == one.mistake.kind; });
  };
  for (const Tried& one : tried)
    if (one.relative <= kCheckRules.tie * least->relative && Claimable(one, before)) best.push_back(one);
  for (const Tried& one : tried)
    if (one.relative > kCheckRules.tie * least->relative && !same_kind(one))
      next = std::min(next, one.relative);
  if (RatioOf(*least, before) > kCheckRules.sure && next < kCheckRules.clear * least->relative) return {};
  // Of one kind one is enough, the simplest; and a tie with a fitted size is no tie.
  std::vector<Tried> named;
  for (const Tried& one : best) {
    const bool again = std::any_of(named.begin(), named.end(), [&](const Tried& other) {
      return other.mistake.kind == one.mistake.kind;
    });
    if (!again && named.size() < kCheckRules.max_named && !(one.mistake.free_size && !named.empty()))
      named.push_back(one);
  }
  return named;
}

std::vector<Tried> TryAll(const Trial& trial, const std::vector<Mistake>& mistakes, ThreadPool* pool) {
  std::vector<std::optional<Tried>> results(mistakes.size());
  ParallelFor(pool, static_cast<int>(mistakes.size()), 4, [&](int begin, int end) {
    for (int m = begin; m < end; ++m) {
      absl::StatusOr<TrialResult> after = trial.Run(mistakes[m].fix);
      if (!after.ok()) continue;
      const double relative = after->Relative({});
      results[m] = Tried{mistakes[m], *std::move(after), relative};
    }
  });
  std::vector<Tried> tried;
  for (std::optional<Tried>& result : results)
    if (result && !result->after.objects.empty()) tried.push_back(*std::move(result));
  return tried;
}

std::vector<Mistake> AllMistakes(const Trial& trial, const TrialResult& before) {
  std::vector<Mistake> mistakes = MisnamedObjects(trial, before);
  for (Mistake& mistake : MistakesOfFiles(trial.input().set->fingers, before.speed_m_s))
    mistakes.push_back(std::move(mistake));
  for (Mistake& mistake : OriginsOfBoundingBox(trial)) mistakes.push_back(std::move(mistake));
  return mistakes;
}

}  // namespace touchstone::diagnosis::checks
