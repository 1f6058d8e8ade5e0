#include "server/diagnosis/selection/session/turns.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::selection {
namespace {

using testing::HasSubstr;

// Finger 1 of touch k is later by `late_s[k % late_s.size()]`.
touches::SyntheticSet InTurn(const std::vector<double>& late_s, int rounds, uint64_t seed) {
  touches::SyntheticSet set(3, 47, rounds, touches::kSyntheticSigmaS, seed);
  for (int k = 0; k < set.size(); ++k) set.observations.time_s[k * 3 + 1] += late_s[k % late_s.size()];
  set.Finish();
  return set;
}

std::optional<Turns> TurnsOf(const touches::SyntheticSet& set) {
  return FindTurns(set.observations, set.residuals);
}

TEST(Turns, AreFoundWithTheirPeriodAndSize) {
  const std::vector<double> turns[] = {{0, 9e-3}, {-5e-3, 0, 5e-3}, {0, 0, 0, 0, 15e-3}};
  for (const std::vector<double>& late_s : turns)
    for (const int rounds : {1, 3}) {
      const auto found = TurnsOf(InTurn(late_s, rounds, 7));
      ASSERT_TRUE(found) << late_s.size() << " in " << rounds;
      EXPECT_EQ(found->period, late_s.size());
      EXPECT_EQ(found->finger, 1);
      // Of three fingers less their mean one shows two thirds.
      EXPECT_NEAR(found->range_s, 2 * (late_s.back() - late_s.front()) / 3, 2.5e-3);
      EXPECT_THAT(found->words, HasSubstr("finger m is up to"));
    }
}

// A misfit is the same in all repeats of a pose, and poses come in the same order in every round.
TEST(Turns, AreNoMisfitThatRepeats) {
  touches::SyntheticSet set(1, 48, 30, touches::kSyntheticSigmaS, 6);
  RandomStream random(7, RandomDomain::kTest);
  std::vector<double> late_s(48);
  for (double& pose_s : late_s) pose_s = 20e-3 * random.Normal();
  for (int k = 0; k < set.size(); ++k) set.observations.time_s[k * 3 + 1] += late_s[set.observations.pose[k]];
  set.Finish();
  EXPECT_FALSE(TurnsOf(set));
}

// Touches that go round six faces, with an error that depends on the face.
TEST(Turns, AreNoFacesInTurn) {
  for (const int rounds : {1, 4}) {
    touches::SyntheticSet set(1, 96, rounds, touches::kSyntheticSigmaS, 8);
    auto faces = std::make_shared<session::MeasurementSet>(*set.observations.set);
    for (int k = 0; k < set.size(); ++k) {
      const int face = set.observations.pose[k] % 6;
      faces->approach[k] = (face % 2 ? 1 : -1) * Eigen::Vector3d::Unit(face / 2);
      set.observations.time_s[k * 3 + 1] += 4e-3 * face * (face % 2 ? 1 : -1);
    }
    set.observations.set = faces;
    set.Finish();
    EXPECT_FALSE(TurnsOf(set)) << rounds;
  }
}

// Four places of which two and two say the same, at the price of more values.
TEST(Turns, AreNoMultipleOfTheirPeriod) {
  const auto found = TurnsOf(InTurn({0, 30e-3}, 8, 1));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->period, 2);
}

TEST(Turns, AreNotFoundInNoise) {
  for (uint64_t seed = 0; seed < 60; ++seed) EXPECT_FALSE(TurnsOf(InTurn({0}, 1 + seed % 3, seed))) << seed;
}

TEST(Turns, CountTouchesThatAreLeftOut) {
  touches::SyntheticSet set = InTurn({0, 9e-3}, 3, 5);
  for (int k = 0; k < set.size(); k += 7) set.observations.used[k] = 0;
  const auto found = TurnsOf(set);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->period, 2);
}

TEST(Turns, StandInFrontOfTheCovariates) {
  engine::UnexplainedRest rest;
  rest.covariates = {{"incidence_deg", 1e-5, 9}};
  Turns turns;
  turns.period = 3;
  NameTurnFirst(turns, &rest);
  EXPECT_EQ(rest.covariates[0].name, "place in turns of 3 touches");
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
