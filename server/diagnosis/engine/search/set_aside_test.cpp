#include "server/diagnosis/engine/search/set_aside.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace touchstone::diagnosis::engine {
namespace {

using ::testing::HasSubstr;

constexpr int kMeasurements = 1000;

// Measurement i is of object i % 4.
Division ObjectsByTurns() {
  Division objects{{"of a", "of b", "of c", "of d"}, {}};
  for (int i = 0; i < kMeasurements; ++i) objects.group.push_back(i % 4);
  return objects;
}

std::vector<char> Aside(const std::vector<int>& which) {
  std::vector<char> aside(kMeasurements, 0);
  for (const int i : which) aside[i] = 1;
  return aside;
}

SetAside Assess(const std::vector<int>& which, double rmse = 5) {
  return AssessSetAside(Aside(which), {ObjectsByTurns()}, rmse, 5, "touches");
}

TEST(SetAside, SaysNothingOfNone) {
  EXPECT_FALSE(Assess({}, 500).is_finding);
  EXPECT_EQ(Assess({}).words, "");
}

TEST(SetAside, ASlipMayBeOffByAnyAmount) {
  const auto assess = [](const std::vector<int>& which, int slips) {
    return AssessSetAside(Aside(which), {ObjectsByTurns()}, 500, 5, "touches", slips).is_finding;
  };
  EXPECT_FALSE(assess({17, 302}, 3));
  EXPECT_TRUE(assess({17, 302}, 0));
  EXPECT_TRUE(assess({17, 302, 511, 730}, 3));
  EXPECT_TRUE(assess({17, 18, 19}, 3));
}

TEST(SetAside, TakesAFewSpreadOnesForGrossErrors) {
  const SetAside assessed = Assess({17, 302, 511, 730, 991});
  EXPECT_FALSE(assessed.is_finding);
  EXPECT_THAT(assessed.words, HasSubstr("5 of 1000 touches (0.5 %)"));
  EXPECT_THAT(assessed.words, HasSubstr("nothing that they share"));
}

TEST(SetAside, TakesMoreThanOneInAHundredForAFinding) {
  EXPECT_TRUE(Assess({10, 91, 172, 253, 334, 415, 496, 577, 658, 739, 820}).is_finding);
}

TEST(SetAside, NamesTheGroupThatTheyShare) {
  const SetAside assessed = Assess({1, 101, 205, 313, 405, 521, 633, 745});
  EXPECT_TRUE(assessed.is_finding);
  EXPECT_THAT(assessed.words, HasSubstr("8 of them are of b"));
}

TEST(SetAside, SeesThatTheyFollowOneAnother) {
  const SetAside assessed = Assess({400, 401, 402, 403});
  EXPECT_TRUE(assessed.is_finding);
  EXPECT_THAT(assessed.words, HasSubstr("follow one another"));
}

TEST(SetAside, ForbidsAnErrorFarAboveTheNoise) {
  EXPECT_FALSE(Assess({17, 302}, 6.4).is_finding);
  EXPECT_TRUE(Assess({17, 302}, 6.6).is_finding);
}

// By chance alone: p 0.001 for what they share and for neighbours.
TEST(SetAside, HasASmallPWhereItIsAFinding) {
  EXPECT_EQ(Assess({17, 302}).p, 1);
  EXPECT_LT(Assess({10, 91, 172, 253, 334, 415, 496, 577, 658, 739, 820}).p, 1e-9);  // many
  EXPECT_LT(Assess({17, 302}, 6.6).p, 1e-9);                                         // far off
}

TEST(SetAside, IsSeldomMistakenByChance) {
  int findings = 0;
  uint64_t state = 1;
  for (int set = 0; set < 500; ++set) {
    std::vector<int> which;
    for (int n = 0; n < 8; ++n) {
      state = state * 6364136223846793005ull + 1442695040888963407ull;
      which.push_back(static_cast<int>((state >> 33) % kMeasurements));
    }
    findings += Assess(which).is_finding;
  }
  EXPECT_LE(findings, 4);
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
