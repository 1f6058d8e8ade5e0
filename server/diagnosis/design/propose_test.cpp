#include "server/diagnosis/design/propose.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "server/base/units.h"
#include "server/diagnosis/design/rules.h"
#include "server/diagnosis/design/touch_candidates.h"
#include "server/diagnosis/touches/prediction.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis::design {
namespace {

using Effects = std::vector<std::pair<std::string, std::vector<std::string>>>;

constexpr double kSigmaS = 0.002;

std::shared_ptr<const model::Model> ModelWith(const Effects& effects) {
  return std::make_shared<const model::Model>(touches::WithEffects(model::NominalModel(), effects));
}

touches::Observations Present() {
  touches::HiddenRig rig;
  rig.hidden = {};
  auto observations = touches::MakeObservations(touches::MakeTestInput(rig));
  EXPECT_TRUE(observations.ok()) << observations.status();
  return *std::move(observations);
}

std::vector<ProposedTouch> Proposed(const std::vector<Effects>& competing, int touches, uint64_t seed = 1) {
  std::vector<engine::ExplanationsLeft::NamedModel> models;
  for (const Effects& effects : competing) models.push_back({effects.back().first, ModelWith(effects)});
  auto proposed = ProposeTouches(Present(), models, kSigmaS, touches, seed, nullptr);
  EXPECT_TRUE(proposed.ok()) << proposed.status();
  return *std::move(proposed);
}

const Effects kLength = {{"finger_length", {"offset_mm=0.2,-0.1,-0.1"}}};
const Effects kLatency = {{"channel_latency", {"latency_us=10000,-5000,-5000"}}};

TEST(ProposeTouches, LengthAndLatencyAreToldApartByAnotherSpeedOnly) {
  const auto proposed = Proposed({kLength, kLatency}, 12);
  ASSERT_EQ(proposed.size(), 12u);
  std::set<std::string> objects;
  for (const ProposedTouch& touch : proposed) {
    EXPECT_GT(std::abs(touch.touch.speed_m_s - 0.02), 0.005);
    EXPECT_EQ(touch.purpose, "tells finger_length from channel_latency");
    EXPECT_GT(touch.separation_sigmas, 0);
    objects.insert(touch.object);
  }
  EXPECT_GE(objects.size(), 2u);
}

TEST(ProposeTouches, WhatNoTouchCanTellGivesNone) {
  // Exactly the same physics in relative times.
  EXPECT_THAT(
      Proposed({{{"speed_error", {"relative=0.01"}}}, {{"clock_skew", {"relative=-0.00990099009901"}}}}, 12),
      testing::IsEmpty());
}

// One that holds the other: a common sag is a shift of every object along z, whatever else the pose fits of the noise.
TEST(ProposeTouches, WhatTheOtherImitatesExactlyIsToldByNone) {
  const Effects sag = {{"gravity_sag", {"drop_mm=0.3"}}};
  const Effects shift = {
      {"object_pose", {"translation_mm=0.002,-0.001,0.3", "rotation_deg=0.001,0.002,-0.001"}}};
  EXPECT_EQ(Proposed({sag, shift}, 12).size(), 0u);
  EXPECT_EQ(Proposed({shift, sag}, 12).size(), 0u);
}

TEST(ProposeTouches, SayHowManyReachAVerdict) {
  // 6 nats are 12 squared sigmas between the models, whoever of them is right; more touches reach them in fact.
  const auto few = Proposed({kLength, kLatency}, 1);
  const auto many = Proposed({kLength, kLatency}, 12);
  ASSERT_EQ(few.size(), 1u);
  ASSERT_EQ(many.size(), 12u);
  double squares = 0;
  int reached = 0;
  for (const ProposedTouch& touch : many) {
    squares += touch.separation_sigmas * touch.separation_sigmas;
    ++reached;
    if (0.5 * squares >= kDesignRules.verdict_nats) break;
  }
  ASSERT_LT(reached, 12);
  EXPECT_EQ(many[0].touches_to_verdict, reached);
  EXPECT_EQ(few[0].touches_to_verdict, std::ceil(12 / std::pow(few[0].separation_sigmas, 2)));
  // One model has no other to be told from.
  EXPECT_EQ(Proposed({kLength}, 2)[0].touches_to_verdict, 0);
}

TEST(ProposeTouches, TellMoreThanTouchesAtRandom) {
  const Effects radius = {{"tip_radius", {"radius_mm=1"}}}, slip = {{"oblique_slip", {"travel_mm=-0.2"}}};
  Effects allowed = slip;
  allowed[0].second = {"travel_mm=0.2"};
  const auto proposed = Proposed({radius, allowed}, 12);
  ASSERT_EQ(proposed.size(), 12u);
  double designed = 0;
  for (const ProposedTouch& touch : proposed) designed += touch.separation_sigmas * touch.separation_sigmas;

  // The mean square difference of the two at touches of the set, even without a refit that makes it smaller.
  const touches::Observations present = Present();
  const auto a = touches::Predict(present, *ModelWith(radius), false, false, nullptr);
  const auto b = touches::Predict(present, *ModelWith(allowed), false, false, nullptr);
  double random = 0;
  int count = 0;
  for (int k = 0; k < present.size(); ++k) {
    double sum = 0, squares = 0;
    for (int i = 0; i < 3; ++i) {
      const double d = (a->time_s[k * 3 + i] - b->time_s[k * 3 + i]) / kSigmaS;
      sum += d, squares += d * d;
    }
    if (std::isnan(sum)) continue;
    random += squares - sum * sum / 3;
    ++count;
  }
  EXPECT_GT(designed / 12, 2 * random / count);
}

TEST(ProposeTouches, ForOneExplanationLearnItsValues) {
  const auto proposed = Proposed({{{"tip_radius", {"radius_mm=1.5"}}}}, 8);
  ASSERT_EQ(proposed.size(), 8u);
  for (const ProposedTouch& touch : proposed) EXPECT_EQ(touch.purpose, "learns the values of tip_radius");
  // The first touch teaches most.
  EXPECT_GE(proposed.front().separation_sigmas, proposed.back().separation_sigmas);
}

TEST(ProposeTouches, EachOfSeveralModelsIsToldFromTheBest) {
  const auto proposed = Proposed({kLength, kLatency, {{"tool_tilt", {"angle_deg=0.3"}}}}, 12);
  std::set<std::string> purposes;
  for (const ProposedTouch& touch : proposed) purposes.insert(touch.purpose);
  EXPECT_THAT(purposes, testing::UnorderedElementsAre("tells finger_length from channel_latency",
                                                      "tells finger_length from tool_tilt"));
}

TEST(ProposeTouches, TheSameSeedProposesTheSame) {
  const auto once = Proposed({kLength, kLatency}, 5), twice = Proposed({kLength, kLatency}, 5),
             other = Proposed({kLength, kLatency}, 5, 2);
  for (int n = 0; n < 5; ++n) {
    EXPECT_EQ(once[n].object, twice[n].object);
    EXPECT_EQ(once[n].touch.target_m, twice[n].touch.target_m);
    EXPECT_EQ(once[n].touch.approach, twice[n].touch.approach);
    EXPECT_EQ(once[n].touch.speed_m_s, twice[n].touch.speed_m_s);
    EXPECT_EQ(once[n].separation_sigmas, twice[n].separation_sigmas);
  }
  EXPECT_NE(once[0].touch.target_m, other[0].touch.target_m);
}

TEST(TouchCandidates, EndOnSmoothSurfacesAndKeepUnitVectors) {
  const touches::Observations present = Present();
  const auto candidates = MakeCandidates(present, model::NominalModel(), {}, nullptr);
  ASSERT_TRUE(candidates.ok()) << candidates.status();
  EXPECT_GT(candidates->size(), 150);
  const auto here = touches::Predict(*candidates, model::NominalModel(), true, false, nullptr);
  std::set<double> speeds;
  for (int k = 0; k < candidates->size(); ++k) {
    const int row = candidates->row[k];
    speeds.insert(std::round(candidates->set->speed_m_s[row] * 1e6));
    EXPECT_NEAR(candidates->set->approach[row].dot(candidates->set->lateral[row]), 0, 1e-12);
    for (int i = 0; i < 3; ++i) EXPECT_FALSE(std::isnan(here->time_s[k * 3 + i]));
  }
  EXPECT_THAT(speeds, testing::ElementsAre(10000, 20000, 40000));
}

}  // namespace
}  // namespace touchstone::diagnosis::design
