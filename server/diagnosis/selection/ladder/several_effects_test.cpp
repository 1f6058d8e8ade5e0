// Sets in which many effects are missing at once, of which some show only beside others.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/base/test_tier.h"
#include "server/diagnosis/selection/ladder/ladder.h"
#include "server/diagnosis/selection/simulated_test_search.h"

namespace touchstone::diagnosis::selection {
namespace {

using ::testing::UnorderedElementsAreArray;

// The step's effect, or the one of those that the data cannot tell from it that was hidden.
std::string NameAmong(const std::vector<std::string>& hidden, const engine::LadderStep& step) {
  for (const std::string& name : step.equivalent)
    if (std::find(hidden.begin(), hidden.end(), name) != hidden.end()) return name;
  return step.effect;
}

Ladder LadderFor(const touches::HiddenRig& rig) {
  Selected selected = SelectFor(touches::MakeTestInput(rig));
  absl::StatusOr<Ladder> ladder = BuildLadder(*selected.workspace, &selected.result);
  EXPECT_TRUE(ladder.ok()) << ladder.status();
  return *std::move(ladder);
}

// Every hidden effect of the means is a step, no other of the means is, and the error falls with each.
void ExpectMeansFound(const touches::HiddenRig& rig, const Ladder& ladder) {
  std::vector<std::string> hidden, found;
  for (const auto& [effect, values] : rig.hidden)
    if (!effects::Catalogue().Find(effect)->random()) hidden.push_back(effect);
  double last = INFINITY;
  for (const engine::LadderStep& step : ladder.steps) {
    if (effects::Catalogue().Find(step.effect)->random()) continue;
    found.push_back(NameAmong(hidden, step));
    EXPECT_LT(step.quality.rmse, last) << step.effect;
    last = step.quality.rmse;
  }
  EXPECT_THAT(found, UnorderedElementsAreArray(hidden));
}

void ExpectAllFound(const touches::HiddenRig& rig) {
  const Ladder ladder = LadderFor(rig);
  EXPECT_EQ(ladder.verdict, engine::Verdict::kMissingEffects);
  ExpectMeansFound(rig, ladder);
}

// A size that is 2.6 % off makes up for fingers that stand too close and a speed that is too low: either of these, beside it,
// leaves the error as it is.
TEST(SeveralEffects, StepsThatNeedEachOtherAreBothFound) {
  TOUCHSTONE_SECOND_TIER("long: a search for five effects");
  touches::HiddenRig rig;
  rig.samples_per_face = 6;
  rig.rounds = 2;
  rig.hidden = {{"finger_spacing", {"delta_mm=-0.65"}},
                {"finger_length", {"offset_mm=-0.245,0.202,0.043"}},
                {"object_scale", {"relative=0.0163"}},
                {"tip_radius", {"radius_mm=1.84"}},
                {"speed_error", {"relative=-0.0229"}}};
  ExpectAllFound(rig);
}

// A suggested formula may stand for what the search had not reached yet; with the effects in place it is not needed.
TEST(SeveralEffects, SixEffectsAtTwoSpeedsNeedNoFormula) {
  TOUCHSTONE_SECOND_TIER("long: a search for six effects");
  touches::HiddenRig rig;
  rig.objects = {"lat00", "lat05", "lat15", "lat20"};
  rig.samples_per_face = 4;
  rig.rounds = 4;
  rig.speeds_mm_s = {10, 30};
  rig.sigma_us = 3000;
  rig.hidden = {{"finger_spacing", {"delta_mm=-1.04"}},
                {"finger_length", {"offset_mm=-0.093,-0.1335,0.2265"}},
                {"speed_error", {"relative=-0.0387"}},
                {"channel_latency", {"latency_us=-5270,1429,3841"}},
                {"thermal_drift", {"rate_mm_per_h=-0.1234,0.0178,0.1056"}},
                {"return_hysteresis", {"fraction=0.1747"}}};
  ExpectAllFound(rig);
}

// A curve over time has so much evidence from such noise that it is ahead of any effect in whose place it is put.
TEST(SeveralEffects, CorrelatedNoiseReplacesNoEffectOfThePose) {
  TOUCHSTONE_SECOND_TIER("long: a search for five effects");
  touches::HiddenRig rig;
  rig.samples_per_face = 8;
  rig.rounds = 4;
  rig.sigma_us = 4000;
  rig.hidden = {{"tool_yaw", {"angle_deg=2.47"}},
                {"finger_spacing", {"delta_mm=1.12"}},
                {"object_scale", {"relative=-0.019"}},
                {"oblique_slip", {"travel_mm=0.52"}},
                {"correlated_noise", {"sigma_us=5183", "time_s=305"}}};
  ExpectMeansFound(rig, LadderFor(rig));
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
