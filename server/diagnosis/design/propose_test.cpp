#include "server/diagnosis/design/propose.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "server/base/units.h"
#include "server/diagnosis/design/touch_candidates.h"
#include "server/diagnosis/touches/prediction.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone {
namespace {

using Effects = std::vector<std::pair<std::string, std::vector<std::string>>>;

constexpr double kSigmaS = 0.002;

std::shared_ptr<const Model> Rival(const Effects& effects) {
  return std::make_shared<const Model>(WithEffects(NominalModel(), effects));
}

Observations Present() {
  HiddenRig rig;
  rig.hidden = {};
  auto observations = MakeObservations(MakeTestInput(rig));
  EXPECT_TRUE(observations.ok()) << observations.status();
  return *std::move(observations);
}

std::vector<v1::ProposedTouch> Proposed(const std::vector<Effects>& rivals, int touches, uint64_t seed = 1) {
  std::vector<std::shared_ptr<const Model>> models;
  std::vector<std::string> names;
  for (const Effects& effects : rivals) {
    models.push_back(Rival(effects));
    names.push_back(effects.back().first);
  }
  auto proposed = ProposeTouches(Present(), models, names, kSigmaS, touches, seed, nullptr);
  EXPECT_TRUE(proposed.ok()) << proposed.status();
  return *std::move(proposed);
}

const Effects kLength = {{"finger_length", {"offset_mm=0.2,-0.1,-0.1"}}};
const Effects kLatency = {{"channel_latency", {"latency_us=10000,-5000,-5000"}}};

TEST(ProposeTouches, LengthAndLatencyAreToldApartByAnotherSpeedOnly) {
  const auto proposed = Proposed({kLength, kLatency}, 12);
  ASSERT_EQ(proposed.size(), 12u);
  std::set<std::string> objects;
  for (const v1::ProposedTouch& touch : proposed) {
    EXPECT_GT(std::abs(touch.touch().speed_m_s() - 0.02), 0.005);
    EXPECT_EQ(touch.purpose(), "tells finger_length from channel_latency");
    EXPECT_GT(touch.separation(), 0);
    objects.insert(touch.object());
  }
  EXPECT_GE(objects.size(), 2u);
}

TEST(ProposeTouches, WhatNoTouchCanTellGivesNone) {
  // Exactly the same physics in relative times.
  EXPECT_THAT(
      Proposed({{{"speed_error", {"relative=0.01"}}}, {{"clock_skew", {"relative=-0.00990099009901"}}}}, 12),
      testing::IsEmpty());
}

TEST(ProposeTouches, TellMoreThanTouchesAtRandom) {
  const Effects radius = {{"tip_radius", {"radius_mm=1"}}}, slip = {{"oblique_slip", {"travel_mm=-0.2"}}};
  Effects allowed = slip;
  allowed[0].second = {"travel_mm=0.2"};
  const auto proposed = Proposed({radius, allowed}, 12);
  ASSERT_EQ(proposed.size(), 12u);
  double designed = 0;
  for (const v1::ProposedTouch& touch : proposed) designed += touch.separation() * touch.separation();

  // The mean square difference of the two at touches of the set, even without a refit that makes it smaller.
  const Observations present = Present();
  const auto a = Predict(present, *Rival(radius), false, false, nullptr);
  const auto b = Predict(present, *Rival(allowed), false, false, nullptr);
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
  for (const v1::ProposedTouch& touch : proposed)
    EXPECT_EQ(touch.purpose(), "learns the values of tip_radius");
  // What is learnt first is worth most.
  EXPECT_GE(proposed.front().separation(), proposed.back().separation());
}

TEST(ProposeTouches, EveryOneOfSeveralRivalsIsToldFromTheBest) {
  const auto proposed = Proposed({kLength, kLatency, {{"tool_tilt", {"angle_deg=0.3"}}}}, 12);
  std::set<std::string> purposes;
  for (const v1::ProposedTouch& touch : proposed) purposes.insert(touch.purpose());
  EXPECT_THAT(purposes, testing::UnorderedElementsAre("tells finger_length from channel_latency",
                                                      "tells finger_length from tool_tilt"));
}

TEST(ProposeTouches, TheSameSeedProposesTheSame) {
  const auto once = Proposed({kLength, kLatency}, 5), twice = Proposed({kLength, kLatency}, 5),
             other = Proposed({kLength, kLatency}, 5, 2);
  for (int n = 0; n < 5; ++n) EXPECT_EQ(once[n].SerializeAsString(), twice[n].SerializeAsString());
  EXPECT_NE(once[0].SerializeAsString(), other[0].SerializeAsString());
}

TEST(TouchCandidates, EndOnSmoothSurfacesAndKeepUnitVectors) {
  const Observations present = Present();
  const auto candidates = MakeCandidates(present, NominalModel(), {}, nullptr);
  ASSERT_TRUE(candidates.ok()) << candidates.status();
  EXPECT_GT(candidates->size(), 150);
  const auto here = Predict(*candidates, NominalModel(), true, false, nullptr);
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
}  // namespace touchstone
