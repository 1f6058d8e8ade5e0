#include "tests/hidden_effects/score/arms/outside_strengths.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "server/effects/all_effects.h"
#include "tests/hidden_effects/score/arms/test_objects.h"
#include "tests/hidden_effects/score/verify.h"

namespace touchstone::hidden {
namespace {

const TestObjects& FewObjects() {
  static const auto* objects = [] {
    auto* few = new TestObjects;
    for (const char* name : {"lat05", "lat20"})
      few->solids.push_back(std::make_shared<Solid>(name, SupershapeTriangles(name, 5000)));
    return few;
  }();
  return *objects;
}

Scenario Small() {
  Scenario scenario;
  scenario.objects = FewObjects().solids;
  scenario.poses = 24;
  return scenario;
}

TEST(OutsideArms, CausesHaveTheStrengthOfTheirArm) {
  const double per_sigma = std::sqrt(2.0 * 2 * 24 * 4);
  for (int k = 0; k <= static_cast<int>(CauseKind::kRandomWalk); ++k) {
    const auto kind = static_cast<CauseKind>(k);
    const double part = kind == CauseKind::kRemounted || kind == CauseKind::kPoseError ? 0.4 : 1;
    const auto signal = [&](Strength strength) {
      return SignalOf(DrawnCause(kind, Small(), 5, strength), Small(), 5);
    };
    const std::string words = InWords(DrawnCause(kind, Small(), 5, Strength::kWeak));
    // What is met at an edge does not grow quite in proportion.
    EXPECT_GT(signal(Strength::kWeak), 0.85 * 10) << words;
    EXPECT_LT(signal(Strength::kWeak), 1.15 * 15) << words;
    EXPECT_GT(signal(Strength::kStrong), 0.85 * part * 3 * per_sigma) << words;
    EXPECT_LT(signal(Strength::kStrong), 1.15 * part * 6 * per_sigma) << words;
  }
}

TEST(OutsideArms, TheStrengthOfWhatDependsOnTimeLeavesOutWhatALengthAndADriftExplain) {
  // An offset from the start on is a length.
  EXPECT_NEAR(SignalOf({CauseKind::kMidSession, 0.2, {0}, {1, 0, 0}}, Small(), 5), 0, 0.01);
  // A quarter of the variance of a step in the middle is left beside its line, of twice 1/4 * 2/3 over the fingers.
  const double touches = 2 * 24 * 4, half_s = 9 * touches / 2;
  EXPECT_NEAR(SignalOf({CauseKind::kMidSession, 0.2, {half_s}, {1, 0, 0}}, Small(), 5),
              2 * std::sqrt(touches * 2 / 3 / 4 / 4), 0.4);
}

TEST(OutsideArms, EveryArmComesInThreeStrengthsAndAnswersToItsName) {
  int weak = 0, realistic = 0, strong = 0;
  std::set<std::string> names;
  for (const Arm& arm : Arms()) {
    weak += arm.strength == Strength::kWeak, realistic += arm.strength == Strength::kRealistic;
    strong += arm.strength == Strength::kStrong;
    EXPECT_TRUE(names.insert(arm.name).second) << arm.name;
    EXPECT_EQ(FindArm(arm.name), &arm);
  }
  EXPECT_GE(weak, 30);
  EXPECT_EQ(weak, realistic);
  EXPECT_EQ(weak, strong);
}

TEST(OutsideArms, ModelsCanBeReadAndSomethingIsWrongWithEverySet) {
  for (const Arm& arm : Arms()) {
    if (arm.strength != Strength::kStrong) continue;
    const uint64_t seed = SeedOf(Seeds::kTuning, arm, 1);
    const Scenario scenario = arm.draw(FewObjects(), seed);
    const Set set = Generate(scenario, seed);
    EXPECT_TRUE(model::ParseModel(set.model_yaml, "n", effects::Catalogue()).ok()) << set.model_yaml;
    EXPECT_FALSE(scenario.causes.empty() && scenario.data_errors.empty() && scenario.hidden.empty() &&
                 scenario.in_model.empty() && scenario.model_sigma_us == 0)
        << arm.name;
    if (arm.kind == Kind::kTooFew) {
      EXPECT_LE(set.touches, 6) << arm.name;
    }
  }
}

TEST(OutsideArms, BeyondItsBoundIsWhatTheCatalogueRefuses) {
  for (uint64_t seed = 0; seed < 8; ++seed) {
    const Hidden hidden = BeyondBound(Small(), seed, Strength::kRealistic);
    double sum = 0, largest = 0;
    for (const double value : hidden.values) sum += value, largest = std::max(largest, std::abs(value));
    if (hidden.values.size() > 1) {
      EXPECT_NEAR(sum, 0, 1e-9) << hidden.effect;
    }
    EXPECT_GE(largest, 7.5) << hidden.effect;
  }
}

TEST(Verify, AddsAnEffectWithOrWithoutItsList) {
  const std::string model = "touchstone: model/1\neffects:\n  - gaussian_noise: {sigma_us: 5000}\n";
  const std::string item = "  - formula:\n      name: f\n";
  EXPECT_EQ(WithEffect(model, "- formula:\n    name: f\n"), model + item);
  EXPECT_EQ(WithEffect(model, item), model + item);
  EXPECT_EQ(WithEffect(model, "effects:\n" + item), model + item);
  EXPECT_EQ(WithEffect("touchstone: model/1\n", item), "touchstone: model/1\neffects:\n" + item);
}

}  // namespace
}  // namespace touchstone::hidden
