#include "server/diagnosis/selection/session/session_order.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/selection/ladder/ladder.h"
#include "server/diagnosis/selection/simulated_test_search.h"
#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::selection {
namespace {

using ::testing::HasSubstr;

// Five objects in one round, one after another.
touches::Observations OneAfterAnother() {
  return touches::SyntheticSet(5, 20, 1, 0.005, 1).observations;
}

std::vector<engine::ParameterEstimate> ValuesOf(const touches::Observations& o,
                                                const std::vector<double>& values) {
  std::vector<engine::ParameterEstimate> estimates;
  for (size_t object = 0; object < values.size(); ++object) {
    engine::ParameterEstimate& estimate = estimates.emplace_back();
    estimate.name = "radius_mm";
    estimate.unit = "mm";
    estimate.object = o.objects[object];
    estimate.value = values[object];
    estimate.std_error = 0.01;
  }
  return estimates;
}

TEST(OrderInWords, NamesTheStretchInWhichTheOnlyObjectWasTouched) {
  EXPECT_THAT(OrderInWords(OneAfterAnother(), "object4", {}, false), HasSubstr("from touch 80 to touch 99"));
}

TEST(OrderInWords, TellsSteadyGrowthInTheOrderOfTouching) {
  const touches::Observations o = OneAfterAnother();
  EXPECT_THAT(OrderInWords(o, "", ValuesOf(o, {1.0, 1.1, 1.2, 1.3, 1.4}), false),
              HasSubstr("by 1.8 mm an hour"));
  const std::string unsteady = OrderInWords(o, "", ValuesOf(o, {1.0, 1.4, 1.0, 1.3, 1.4}), false);
  EXPECT_THAT(unsteady, HasSubstr("one after another"));
}

// The kind: object_scale that rose from object to object in the order of touching was said without a word about time.
TEST(OrderInWords, OfWhatObjectsHaveOfTheirOwnSaysSteadyGrowthAlone) {
  const touches::Observations o = OneAfterAnother();
  EXPECT_THAT(OrderInWords(o, "", ValuesOf(o, {1.0, 1.1, 1.2, 1.3, 1.4}), true),
              HasSubstr("by 1.8 mm an hour"));
  EXPECT_EQ(OrderInWords(o, "", ValuesOf(o, {1.0, 1.4, 1.0, 1.3, 1.4}), true), "");
  EXPECT_EQ(OrderInWords(o, "object4", {}, true), "");
}

TEST(OrderInWords, SaysNothingWhereObjectsAreTouchedInTurns) {
  const touches::Observations o = touches::SyntheticSet(5, 20, 2, 0.005, 1).observations;
  EXPECT_EQ(OrderInWords(o, "object4", {}, false), "");
  EXPECT_EQ(OrderInWords(o, "", ValuesOf(o, {1, 1.1, 1.2, 1.3, 1.4}), false), "");
}

// A cause that grows with the square root of the speed: two effects fit it at two speeds.
TEST(PairsAtTwoSpeeds, AsksForAThirdSpeed) {
  touches::HiddenRig rig;
  rig.samples_per_face = 6;
  DiagnosisInput input = touches::MakeTestInput(rig);
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  const double share[] = {1, -0.3, -0.7};
  for (int row = 0; row < set->size(); ++row) {
    const double speed_m_s = row % 2 == 0 ? 0.01 : 0.04, before_m_s = set->speed_m_s[row];
    for (int i = 0; i < 3; ++i) {
      double& time_s = set->time_s[row * 3 + i];
      time_s = time_s * before_m_s / speed_m_s + share[i] * 0.002 / std::sqrt(speed_m_s);
    }
    set->speed_m_s[row] = speed_m_s;
  }
  input.set = set;
  Selected selected = SelectFor(input);
  const auto ladder = BuildLadder(*selected.workspace, &selected.result);
  ASSERT_TRUE(ladder.ok()) << ladder.status();
  int doubted = 0;
  for (const engine::LadderStep& step : ladder->steps) {
    if (step.effect != "finger_length" && step.effect != "channel_latency") continue;
    ++doubted;
    EXPECT_LE(step.probability, 0.5);
    EXPECT_THAT(step.words, HasSubstr("measure at a third one"));
  }
  EXPECT_EQ(doubted, 2);
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
