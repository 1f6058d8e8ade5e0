#include "server/diagnosis/distributions/round_findings.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/test_tier.h"
#include "server/diagnosis/distributions/pose_free_test_set.h"

namespace touchstone::diagnosis::distributions {
namespace {

using ::testing::Contains;
using ::testing::IsEmpty;

std::vector<RoundFinding> Found(const DiagnosisInput& input) {
  const DiagnosisContext context;
  const auto experiment = PoseFreeExperiment::Create(input, context);
  EXPECT_TRUE(experiment.ok()) << experiment.status();
  return FindInRounds(**experiment);
}

DiagnosisInput InputWith(const std::string& effects, uint64_t seed,
                         const std::string& nominal = kWedgeNoise) {
  return MakePoseFreeInput(WedgeModel(std::string(kWedgeNoise) + effects), 8, 4, seed, nominal, 2);
}

const RoundFinding* Of(const std::vector<RoundFinding>& findings, RoundFindingKind kind) {
  for (const RoundFinding& finding : findings)
    if (finding.kind == kind) return &finding;
  return nullptr;
}

// Touch k of a set moved by a course in the session.
DiagnosisInput Moved(DiagnosisInput input, const std::function<double(int row, int finger)>& late_s) {
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  for (int row = 0; row < set->size(); ++row) {
    double first = INFINITY;
    for (int i = 0; i < 3; ++i) first = std::min(first, set->time_s[row * 3 + i] += late_s(row, i));
    for (int i = 0; i < 3; ++i) set->time_s[row * 3 + i] -= first;
  }
  input.set = set;
  return input;
}

TEST(FindInRounds, FindsNothingInNoise) {
  TOUCHSTONE_SECOND_TIER("statistical: the rate of false findings over many sets");
  for (uint64_t seed = 0; seed < 60; ++seed) EXPECT_THAT(Found(InputWith("", seed)), IsEmpty()) << seed;
}

TEST(FindInRounds, SeesADriftWithSeveralEffectsThatWouldDoIt) {
  const auto findings =
      Found(Moved(InputWith("", 1), [](int row, int i) { return (i - 1) * 0.00004 * row; }));
  const RoundFinding* const session = Of(findings, RoundFindingKind::kSession);
  ASSERT_NE(session, nullptr);
  EXPECT_LT(session->p_value, 1e-6);
  EXPECT_THAT(session->compatible, Contains("thermal_drift"));
  EXPECT_GE(session->compatible.size(), 2u);
}

TEST(FindInRounds, SeesAnOffsetThatBeginsInMidSession) {
  const auto findings =
      Found(Moved(InputWith("", 2), [](int row, int i) { return i == 1 && row > 90 ? 0.006 : 0.0; }));
  EXPECT_NE(Of(findings, RoundFindingKind::kSession), nullptr);
}

// Whether rounds change with the place or with what came before, poses would have to tell: either may be said.
TEST(FindInRounds, ListsHysteresisWhereThePreviousPressLeavesSomething) {
  DiagnosisInput input = InputWith("", 3);
  const auto before = input.set;
  const auto findings = Found(Moved(input, [&](int row, int i) {
    if (row == 0) return 0.0;
    const auto* t = &before->time_s[(row - 1) * 3];
    // As reported, noise included: rounds of one order of poses differ in nothing else.
    return -0.4 * (std::max({t[0], t[1], t[2]}) - t[i]);
  }));
  bool listed = false;
  for (const RoundFinding& finding : findings)
    listed |= std::count(finding.compatible.begin(), finding.compatible.end(), "return_hysteresis") > 0;
  EXPECT_TRUE(listed) << findings.size() << " findings";
}

TEST(FindInRounds, SeesTailsUnlessTheModelHasThem) {
  const std::string tails = "  - heavy_tail_noise: {degrees_of_freedom: 3}\n";
  const RoundFinding* found = nullptr;
  const auto findings = Found(InputWith(tails, 4));
  found = Of(findings, RoundFindingKind::kTails);
  ASSERT_NE(found, nullptr);
  EXPECT_THAT(found->compatible, Contains("heavy_tail_noise"));
  EXPECT_THAT(found->compatible, Contains("incidence_noise"));
  EXPECT_EQ(Of(Found(InputWith(tails, 4, kWedgeNoise + tails)), RoundFindingKind::kTails), nullptr);
}

TEST(FindInRounds, SeesTheTicksOfAPollingLoop) {
  const std::string ticks = "  - poll_interval: {interval_us: 40000}\n";
  const auto findings = Found(InputWith(ticks, 5));
  const RoundFinding* const found = Of(findings, RoundFindingKind::kTicks);
  ASSERT_NE(found, nullptr);
  EXPECT_THAT(found->words, testing::HasSubstr("multiples of 40 ms"));
  EXPECT_LT(found->p_value, 1e-12);
  EXPECT_EQ(Of(Found(InputWith(ticks, 5, kWedgeNoise + ticks)), RoundFindingKind::kTicks), nullptr);
}

TEST(CommonTick, IsTheLargestAndNoneOfOtherTimes) {
  RandomStream random(1, RandomDomain::kTest);
  std::vector<double> ticks, any;
  for (int n = 0; n < 300; ++n) {
    any.push_back(random.Uniform(0, 2));
    ticks.push_back(std::ceil(any.back() / 0.025) * 0.025);
  }
  EXPECT_NEAR(CommonTick(ticks), 0.025, 2e-5);
  EXPECT_EQ(CommonTick(any), 0);
}

}  // namespace
}  // namespace touchstone::diagnosis::distributions
