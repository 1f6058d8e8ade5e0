#include "server/diagnosis/residuals/slices/model_comparison.h"

#include <algorithm>
#include <cmath>

#include "server/base/numbers/random.h"
#include "server/diagnosis/residuals/slices/covariates.h"
#include "server/diagnosis/residuals/slices/rules.h"

namespace touchstone::diagnosis::residuals {
namespace {

// Sums of squares of the readings of one pose.
struct PoseSums {
  double first = 0, other = 0, degrees_of_freedom = 0;
  void operator+=(const PoseSums& more) {
    first += more.first, other += more.other, degrees_of_freedom += more.degrees_of_freedom;
  }
  double Difference() const {
    return std::sqrt(other / degrees_of_freedom) - std::sqrt(first / degrees_of_freedom);
  }
};

// Residuals of the readings that both models expect, each less its mean over the touch's fingers.
void KeepCommon(int fingers, std::vector<double>* one, std::vector<double>* other) {
  for (size_t first = 0; first < one->size(); first += static_cast<size_t>(fingers)) {
    double sum_one = 0, sum_other = 0;
    int count = 0;
    for (size_t e = first; e < first + static_cast<size_t>(fingers); ++e) {
      if (std::isnan((*one)[e]) || std::isnan((*other)[e])) (*one)[e] = (*other)[e] = NAN;
      if (std::isnan((*one)[e])) continue;
      sum_one += (*one)[e], sum_other += (*other)[e], ++count;
    }
    for (size_t e = first; e < first + static_cast<size_t>(fingers); ++e) {
      if (count < 2) (*one)[e] = (*other)[e] = NAN;
      (*one)[e] -= sum_one / std::max(count, 1), (*other)[e] -= sum_other / std::max(count, 1);
    }
  }
}

std::vector<PoseSums> SumsOfPoses(const touches::Observations& o, const std::vector<double>& first,
                                  const std::vector<double>& other) {
  std::vector<PoseSums> poses(o.poses);
  for (int k = 0; k < o.size(); ++k) {
    const int compared = FingersCompared(o, first, k);
    if (!o.used[k] || compared < 2) continue;
    PoseSums& pose = poses[o.pose[k]];
    pose.degrees_of_freedom += compared - 1;
    for (size_t e = static_cast<size_t>(k) * o.fingers; e < static_cast<size_t>(k + 1) * o.fingers; ++e)
      if (!std::isnan(first[e])) pose.first += first[e] * first[e], pose.other += other[e] * other[e];
  }
  poses.erase(std::remove_if(poses.begin(), poses.end(),
                             [](const PoseSums& pose) { return pose.degrees_of_freedom == 0; }),
              poses.end());
  return poses;
}

void Bootstrap(const std::vector<PoseSums>& poses, uint64_t seed, ModelDifference* result) {
  std::vector<double> differences;
  for (int draw = 0; draw < kSliceRules.bootstrap_draws; ++draw) {
    RandomStream random(seed, RandomDomain::kDiagnosis, static_cast<uint64_t>(draw), 5);
    PoseSums sum;
    for (size_t n = 0; n < poses.size(); ++n) sum += poses[random.Below(poses.size())];
    differences.push_back(sum.Difference());
    result->other_better += differences.back() < 0;
  }
  result->other_better /= kSliceRules.bootstrap_draws;
  std::sort(differences.begin(), differences.end());
  result->lower_s = differences[kSliceRules.bootstrap_draws * 25 / 1000];
  result->upper_s = differences[kSliceRules.bootstrap_draws * 975 / 1000 - 1];
}

}  // namespace

std::vector<DecidingTouch> FindDecidingTouches(const touches::Observations& o,
                                               const std::vector<double>& before,
                                               const std::vector<double>& after, double sigma_s, size_t count,
                                               bool rises) {
  std::vector<DecidingTouch> touches;
  for (int k = 0; k < o.size(); ++k) {
    if (!o.used[k]) continue;
    DecidingTouch touch{o.set->touch[o.row[k]], o.objects[o.object[k]]};
    double most = 0;
    for (int i = 0; i < o.fingers; ++i) {
      const size_t e = static_cast<size_t>(k) * o.fingers + i;
      if (std::isnan(before[e]) || std::isnan(after[e])) continue;
      const double fall = (before[e] * before[e] - after[e] * after[e]) / (sigma_s * sigma_s);
      touch.fall += fall;
      if (std::abs(fall) <= most) continue;
      most = std::abs(fall);
      touch.finger = i, touch.before_s = before[e], touch.after_s = after[e];
    }
    if (rises ? touch.fall < 0 : touch.fall > 0) touches.push_back(std::move(touch));
  }
  std::stable_sort(touches.begin(), touches.end(), [](const DecidingTouch& a, const DecidingTouch& b) {
    return std::abs(a.fall) > std::abs(b.fall);
  });
  if (touches.size() > count) touches.resize(count);
  return touches;
}

ModelDifference CompareModels(const touches::Observations& o, const touches::Prediction& first,
                              const touches::Prediction& other, double sigma_s, uint64_t seed) {
  std::vector<double> before = touches::Residuals(o, first), after = touches::Residuals(o, other);
  KeepCommon(o.fingers, &before, &after);
  ModelDifference result;
  const std::vector<PoseSums> poses = SumsOfPoses(o, before, after);
  if (poses.size() < 2) return result;
  PoseSums all;
  for (const PoseSums& pose : poses) all += pose;
  result.rmse_s = std::sqrt(all.first / all.degrees_of_freedom);
  result.other_rmse_s = std::sqrt(all.other / all.degrees_of_freedom);
  result.difference_s = all.Difference();
  Bootstrap(poses, seed, &result);
  result.better = FindSlicesBeyond(o, first, before, after, sigma_s);
  result.worse = FindSlicesBeyond(o, other, after, before, sigma_s);
  result.deciding = FindDecidingTouches(o, before, after, sigma_s, kSliceRules.max_deciding, false);
  const std::vector<DecidingTouch> rises =
      FindDecidingTouches(o, before, after, sigma_s, kSliceRules.max_deciding, true);
  result.deciding.insert(result.deciding.end(), rises.begin(), rises.end());
  std::stable_sort(
      result.deciding.begin(), result.deciding.end(),
      [](const DecidingTouch& a, const DecidingTouch& b) { return std::abs(a.fall) > std::abs(b.fall); });
  if (result.deciding.size() > kSliceRules.max_deciding) result.deciding.resize(kSliceRules.max_deciding);
  return result;
}

}  // namespace touchstone::diagnosis::residuals
