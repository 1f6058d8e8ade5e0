#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/selection/simulated_test_search.h"

namespace touchstone::diagnosis::selection {
namespace {

using Effects = std::vector<std::pair<std::string, std::vector<std::string>>>;

// Four rounds of three objects, one after another; `hidden` acts in the touches that `in` names by round and row.
DiagnosisInput WithEffectIn(const Effects& hidden, bool (*in)(int round, int row), uint64_t seed = 1) {
  touches::HiddenRig rig;
  rig.rounds = 4;
  rig.seed = seed;
  DiagnosisInput input = touches::MakeTestInput(rig);
  rig.hidden = hidden;
  const DiagnosisInput other = touches::MakeTestInput(rig);
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  for (int row = 0; row < set->size(); ++row)
    if (in(row / 24 % 4, row))
      for (int i = 0; i < 3; ++i) set->time_s[row * 3 + i] = other.set->time_s[row * 3 + i];
  input.set = set;
  return input;
}

bool InRound2(int round, int) {
  return round == 2;
}
bool InRounds0And1(int round, int) {
  return round < 2;
}
bool Everywhere(int, int) {
  return true;
}

TEST(GroupDifference, NamesTheEffectOfOneRoundWithItsValue) {
  struct Case {
    Effects hidden;
    std::string effect;
    double value;
  };
  const std::vector<Case> cases = {{{{"object_push", {"shift_mm=0.4"}}}, "object_push", 0.4},
                                   {{{"object_scale", {"relative=0.01"}}}, "object_scale", 0.01},
                                   {{{"tool_yaw", {"angle_deg=1"}}}, "tool_yaw", 1}};
  for (const Case& c : cases) {
    SCOPED_TRACE(c.effect);
    const Selected selected = SelectFor(WithEffectIn(c.hidden, InRound2));
    const SelectionResult& result = selected.result;
    ASSERT_TRUE(result.group.has_value());
    EXPECT_EQ(result.group->effect, c.effect);
    EXPECT_EQ(result.group->part, "in round 2");
    EXPECT_NEAR(static_cast<double>(result.group->rows.size()), 72, 4);  // less those at edges
    ASSERT_EQ(result.group->more.size(), 1u);
    EXPECT_NEAR(result.group->more[0].value, c.value, 4 * result.group->more[0].std_error);
    EXPECT_TRUE(result.steps.empty());  // it acts nowhere else
  }
}

TEST(GroupDifference, FindsWhatChangedHalfWay) {
  const Selected selected =
      SelectFor(WithEffectIn({{"channel_latency", {"latency_us=4000,-2000,-2000"}}}, InRounds0And1));
  const SelectionResult& result = selected.result;
  ASSERT_TRUE(result.group.has_value());
  EXPECT_EQ(result.group->part, "in rounds 0 and 1");
  EXPECT_THAT(
      result.group->also,
      ::testing::Contains(result.group->effect == "channel_latency" ? "finger_length" : "channel_latency"));
}

// What acts everywhere alike, and what changes steadily, is told by its own name.
TEST(GroupDifference, IsNotClaimedWhereAnEffectActsThroughoutTheSession) {
  const std::vector<Effects> hidden = {{},
                                       {{"object_push", {"shift_mm=0.4"}}},
                                       {{"thermal_drift", {"rate_mm_per_h=1.2,-0.6,-0.6"}}},
                                       {{"return_hysteresis", {"fraction=0.05"}}},
                                       {{"incidence_noise", {"slope=1"}}},
                                       {{"correlated_noise", {"sigma_us=3000", "time_s=400"}}}};
  for (const Effects& effects : hidden)
    EXPECT_FALSE(SelectFor(WithEffectIn(effects, Everywhere)).result.group.has_value())
        << (effects.empty() ? "nothing" : effects[0].first);
}

TEST(GroupDifference, LeavesWhatActsEverywhereElseItsName) {
  DiagnosisInput input =
      WithEffectIn({{"object_push", {"shift_mm=0.4"}}, {"tip_radius", {"radius_mm=1.5"}}}, InRound2);
  const DiagnosisInput elsewhere = WithEffectIn({{"tip_radius", {"radius_mm=1.5"}}}, Everywhere);
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  for (int row = 0; row < set->size(); ++row)
    if (!InRound2(row / 24 % 4, row))
      for (int i = 0; i < 3; ++i) set->time_s[row * 3 + i] = elsewhere.set->time_s[row * 3 + i];
  input.set = set;
  const Selected selected = SelectFor(input);
  const SelectionResult& result = selected.result;
  ASSERT_TRUE(result.group.has_value());
  EXPECT_EQ(result.group->effect, "object_push");
  ASSERT_EQ(result.steps.size(), 1u);
  EXPECT_EQ(result.fit.model.base().effects[result.steps[0].effect].effect->name, "tip_radius");
}

// Two effects in one round: the one that is named is not said to be all.
TEST(GroupDifference, SaysWhereOneEffectIsNotTheWholeOfIt) {
  const Effects push = {{"object_push", {"shift_mm=0.5"}}};
  Effects both = push;
  both.push_back({"tool_yaw", {"angle_deg=1.5"}});
  const Selected one = SelectFor(WithEffectIn(push, InRound2)), two = SelectFor(WithEffectIn(both, InRound2));
  ASSERT_TRUE(one.result.group.has_value());
  ASSERT_TRUE(two.result.group.has_value());
  EXPECT_THAT(one.result.group->words, ::testing::Not(::testing::HasSubstr("not the whole of it")));
  EXPECT_THAT(two.result.group->words, ::testing::HasSubstr("not the whole of it"));
}

// A round whose times are those of other touches is no effect's.
TEST(GroupDifference, SaysWhereNoEffectTellsWhatWasOther) {
  DiagnosisInput input = WithEffectIn({}, InRound2);
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  std::vector<int> rows;
  for (int row = 0; row < set->size(); ++row)
    if (InRound2(row / 24 % 4, row)) rows.push_back(row);
  for (size_t n = 0; n < rows.size(); ++n)
    for (int i = 0; i < 3; ++i)
      set->time_s[rows[n] * 3 + i] = input.set->time_s[rows[(n * 29 + 11) % rows.size()] * 3 + i];
  input.set = set;
  const Selected selected = SelectFor(input);
  ASSERT_TRUE(selected.result.group.has_value());
  EXPECT_THAT(selected.result.group->words,
              ::testing::HasSubstr("Something was other in round 2, and no effect says what"));
}

// Times that are off by less than files are rounded to have a pattern and no cause.
TEST(GroupDifference, IsNotClaimedWithinRounding) {
  touches::HiddenRig rig;
  rig.rounds = 4;
  rig.sigma_us = 0.1;
  DiagnosisInput input = touches::MakeTestInput(rig);
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  for (int row = 0; row < set->size(); ++row)
    if (InRound2(row / 24 % 4, row)) set->time_s[row * 3] += 5e-6;
  input.set = set;
  EXPECT_FALSE(SelectFor(input).result.group.has_value());
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
