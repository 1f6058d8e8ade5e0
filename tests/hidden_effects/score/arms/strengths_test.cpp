#include "tests/hidden_effects/score/arms/strengths.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/effects/all_effects.h"
#include "tests/hidden_effects/generator/rig.h"
#include "tests/hidden_effects/generator/unlisted.h"
#include "tests/hidden_effects/score/arms/arms.h"

namespace touchstone::hidden {
namespace {

const Scenario& SmallSet() {
  static const Scenario* scenario = [] {
    auto* s = new Scenario;
    for (const char* name : {"lat05", "lat20"})
      s->objects.push_back(std::make_shared<Solid>(name, SupershapeTriangles(name, 5000)));
    s->poses = 24;
    return s;
  }();
  return *scenario;
}

double EffectSignal(const Hidden& hidden, uint64_t seed, bool away_from_edges) {
  const Set plain = Generate(SmallSet(), seed);
  Scenario with = SmallSet();
  with.hidden = {hidden};
  return SignalInStandardErrors(ExactTimesUs(with, plain, seed),
                                away_from_edges ? TimesAwayFromEdges(plain) : plain.exact_time_us, 3,
                                plain.truth.sigma_us);
}

TEST(Strengths, WeakEffectsHaveTheSignalThatWasAskedFor) {
  for (const std::string& effect : EffectsOfExpectation())
    EXPECT_NEAR(EffectSignal(WeakEffect(effect, SmallSet(), 5, 12), 5, true), 12, 0.5) << effect;
}

TEST(Strengths, TouchesAtAnEdgeDoNotCount) {
  // A cube: its faces are met away from the edges but for the touches that straddle one.
  std::vector<Eigen::Vector3d> corners;
  for (int k = 0; k < 8; ++k) corners.emplace_back(k & 1 ? 60 : -60, k & 2 ? 60 : -60, k & 4 ? 60 : -60);
  const Triangles cube{corners,
                       {{0, 2, 1},
                        {1, 2, 3},
                        {4, 5, 6},
                        {5, 7, 6},
                        {0, 1, 4},
                        {1, 5, 4},
                        {2, 6, 3},
                        {3, 6, 7},
                        {0, 4, 2},
                        {2, 4, 6},
                        {1, 3, 5},
                        {3, 7, 5}}};
  Scenario scenario;
  scenario.objects = {std::make_shared<Solid>("cube", cube)};
  Command inside, astride;
  inside.approach = astride.approach = -Eigen::Vector3d::UnitZ();
  inside.lateral = astride.lateral = Eigen::Vector3d::UnitX();
  inside.target_mm = {0, 0, 60}, astride.target_mm = {29.9, 0, 60};
  inside.pose = 0, astride.pose = 1;
  const auto times = TimesAwayFromEdges(GenerateFor(scenario, {inside, astride, inside}, 3));
  for (int i = 0; i < 3; ++i) {
    EXPECT_FALSE(std::isnan(times[i])) << i;
    EXPECT_TRUE(std::isnan(times[3 + i])) << i;
    EXPECT_FALSE(std::isnan(times[6 + i])) << i;
  }
}

TEST(Strengths, RealisticEffectsAreVisible) {
  for (const std::string& effect : EffectsOfExpectation())
    EXPECT_GE(EffectSignal(RealisticEffect(effect, SmallSet(), 5), 5, false), 25) << effect;
}

TEST(Strengths, NumbersAFingerSumToNothing) {
  for (const char* effect : {"finger_length", "channel_latency", "thermal_drift"}) {
    const Hidden hidden = RealisticEffect(effect, SmallSet(), 5);
    ASSERT_EQ(hidden.values.size(), 3u);
    EXPECT_NEAR(hidden.values[0] + hidden.values[1] + hidden.values[2], 0, 1e-9 * std::abs(hidden.values[0]));
  }
}

TEST(Strengths, UnlistedEffectsHaveTheRmsThatWasAskedFor) {
  for (const UnlistedKind& kind : UnlistedKinds()) {
    const Set plain = Generate(SmallSet(), 5);
    Scenario with = SmallSet();
    with.unlisted = {UnlistedEffect(kind.name, SmallSet(), 5, 1)};
    const double signal =
        SignalInStandardErrors(ExactTimesUs(with, plain, 5), plain.exact_time_us, 3, plain.truth.sigma_us);
    // What moves with the travel does not grow quite in proportion.
    EXPECT_NEAR(signal / std::sqrt(2.0 * plain.touches), 1, 0.1) << kind.name;
  }
}

TEST(Arms, KnowEveryEffectOfTheCatalogueWithItsNumberOfValues) {
  for (const auto& effect : effects::TouchEffects()) {
    // Formulas, curves and surfaces that were found by a diagnosis are no causes.
    if (effect->parameters.empty() || effect->name == "lookup" || effect->name == "surface_map") continue;
    // Kinds of noise that no arm hides.
    if (effect->name == "position_noise" || effect->name == "finger_noise") continue;
    EXPECT_EQ(ValueCount(effect->name, 5), effect->ValueCount(5)) << effect->name;
    EXPECT_EQ(IsNoise(effect->name),
              effect->name == "gaussian_noise" || effect->name == "correlated_noise" ||
                  std::count(EffectsOfScatter().begin(), EffectsOfScatter().end(), effect->name) > 0)
        << effect->name;
  }
}

TEST(Arms, TuningAndHeldOutSeedsNeverMeet) {
  uint64_t last_tuning = 0, first_held_out = ~uint64_t{0};
  for (const Arm& arm : Arms()) {
    last_tuning = std::max(last_tuning, SeedOf(Seeds::kTuning, arm, 10 * arm.sets));
    first_held_out = std::min(first_held_out, SeedOf(Seeds::kHeldOut, arm, 0));
    EXPECT_GT(arm.sets, 0);
  }
  EXPECT_LT(last_tuning, first_held_out);
}

TEST(Arms, LatencyAndLengthAreEquivalentAtOneSpeedOnly) {
  Scenario scenario = SmallSet();
  const Hidden latency{"channel_latency", {1000, -2000, 1000}};
  EXPECT_EQ(EquivalentEffects(latency, scenario), std::vector<std::string>{"finger_length"});
  scenario.speeds_mm_s = {20, 50};
  EXPECT_TRUE(EquivalentEffects(latency, scenario).empty());
  // A brake cannot make times shorter.
  EXPECT_EQ(EquivalentEffects({"speed_error", {0.02}}, scenario), std::vector<std::string>{"clock_skew"});
  EXPECT_EQ(EquivalentEffects({"speed_error", {-0.02}}, scenario).size(), 2u);
}

}  // namespace
}  // namespace touchstone::hidden
