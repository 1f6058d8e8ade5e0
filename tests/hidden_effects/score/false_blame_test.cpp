// How often a file without a mistake is blamed for one: physics of every kind of the catalogue and of the causes
// outside of it, realistic and up to eight times as strong. TOUCHSTONE_FALSE_BLAME_SETS=400 tries more sets and prints
// the rate with its interval.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "server/base/test_paths.h"
#include "server/diagnosis/checks/data_problems.h"
#include "tests/hidden_effects/generator/rig.h"
#include "tests/hidden_effects/score/arms/outside_strengths.h"
#include "tests/hidden_effects/score/arms/strengths.h"
#include "tests/hidden_effects/score/judge.h"
#include "tests/hidden_effects/score/table.h"

namespace touchstone::hidden {
namespace {

constexpr int kSets = 42;  // each effect of the catalogue and each cause once
constexpr uint64_t kFirstSeed = 77'000'000;
constexpr double kStrongest = 8;

std::vector<std::string> Effects() {
  std::vector<std::string> effects = EffectsOfExpectation();
  effects.insert(effects.end(), EffectsOfScatter().begin(), EffectsOfScatter().end());
  effects.push_back("surface_error");
  effects.push_back("object_pose");
  return effects;
}

// Stronger than realistic where the values are still what a rig may do: shares and probabilities stay below one.
void Strengthen(double times, Hidden* hidden) {
  static const std::vector<std::string> kShares = {"missed_contact", "contact_slowdown", "return_hysteresis",
                                                   "speed_error",    "clock_skew",       "heavy_tail_noise"};
  const bool share = std::count(kShares.begin(), kShares.end(), hidden->effect) > 0;
  if (share) times = std::min(times, 4.0);
  if (hidden->effect == "heavy_tail_noise") times = 1 / std::sqrt(times);
  if (hidden->effect == "acceleration_ramp") times = 1;
  for (double& value : hidden->values) value *= times;
}

Scenario Draw(const TestObjects& objects, int number, uint64_t seed) {
  auto random = Stream(seed, "blame");
  Scenario scenario;
  scenario.objects = objects.solids;
  if (number % 3 == 1) scenario.poses = 12;  // 240 touches
  if (number % 5 == 2) scenario.speeds_mm_s = {10, 20};
  static const std::vector<std::string> effects = Effects();
  const int kinds = static_cast<int>(effects.size()) + static_cast<int>(CauseKind::kRandomWalk) + 1;
  const int kind = number % kinds;
  if (kind >= static_cast<int>(effects.size())) {
    scenario.causes = {DrawnCause(static_cast<CauseKind>(kind - effects.size()), scenario, seed,
                                  random() % 2 ? Strength::kStrong : Strength::kRealistic)};
    return scenario;
  }
  const double times = std::exp(std::uniform_real_distribution<double>(0, std::log(kStrongest))(random));
  scenario.hidden = {RealisticEffect(effects[kind], scenario, seed)};
  Strengthen(times, &scenario.hidden[0]);
  // Every other set has a second effect.
  if (random() % 2) {
    const std::string& other = effects[random() % effects.size()];
    if (other != effects[kind]) scenario.hidden.push_back(RealisticEffect(other, scenario, seed + 1));
  }
  return scenario;
}

TEST(FalseBlame, FilesWithoutAMistakeAreNotBlamed) {
  const char* const wanted = std::getenv("TOUCHSTONE_FALSE_BLAME_SETS");
  const int sets = wanted != nullptr ? std::atoi(wanted) : kSets;
  const TestObjects objects = LoadTestObjects(SharedData() + "/measurements");
  int blamed = 0;
  double sum_s = 0, slowest_s = 0;
  for (int number = 0; number < sets; ++number) {
    const uint64_t seed = kFirstSeed + number;
    const Set set = Generate(Draw(objects, number, seed), seed);
    const auto input = InputFor(set, objects);
    ASSERT_TRUE(input.ok()) << input.status();
    const auto began = std::chrono::steady_clock::now();
    const auto problems = diagnosis::checks::FindDataProblems(*input, {});
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    sum_s += seconds;
    slowest_s = std::max(slowest_s, seconds);
    ASSERT_TRUE(problems.ok()) << problems.status();
    blamed += !problems->empty();
    EXPECT_TRUE(problems->empty()) << number << ": " << static_cast<int>(problems->front().kind) << ", "
                                   << problems->front().words << "\n  " << TruthInWords(set.truth);
  }
  const auto [low, high] = Interval({blamed, sets});
  printf(
      "%d of %d files without a mistake blamed (95 %%: %.3f to %.3f %%); %.3f s per file, %.3f s at most\n",
      blamed, sets, 100 * low, 100 * high, sum_s / sets, slowest_s);
}

}  // namespace
}  // namespace touchstone::hidden
