#include "server/diagnosis/selection/scatter/pose_scatter.h"
#include "server/base/numbers/random.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/selection/ladder/ladder.h"
#include "server/diagnosis/selection/simulated_test_search.h"

namespace touchstone::diagnosis::selection {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Effects = std::vector<std::pair<std::string, std::vector<std::string>>>;

touches::HiddenRig RigWith(const Effects& hidden) {
  touches::HiddenRig rig;
  rig.samples_per_face = 8;
  rig.rounds = 4;
  rig.sigma_us = 3000;
  rig.hidden = hidden;
  return rig;
}

// The object lies at either end of its play, at random.
DiagnosisInput WithPlay(const std::string& plus, const std::string& minus) {
  const auto input_of = [](const std::string& move) {
    return touches::MakeTestInput(
        RigWith({{"object_pose", {"translation_mm=" + move, "rotation_deg=0,0,0"}}}));
  };
  DiagnosisInput input = input_of(plus);
  const DiagnosisInput other = input_of(minus);
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  RandomStream random(3, RandomDomain::kTest);
  for (int row = 0; row < set->size(); ++row)
    if (random.Uniform() < 0.5)
      for (int i = 0; i < 3; ++i) set->time_s[row * 3 + i] = other.set->time_s[row * 3 + i];
  input.set = set;
  return input;
}

Ladder LadderOf(const DiagnosisInput& input) {
  Selected selected = SelectFor(input);
  auto ladder = BuildLadder(*selected.workspace, &selected.result);
  EXPECT_TRUE(ladder.ok()) << ladder.status();
  return *std::move(ladder);
}

TEST(PoseScatter, PlayIsNoNoiseOfTheFingers) {
  const Ladder ladder = LadderOf(WithPlay("0.2,0,0", "-0.2,0,0"));
  EXPECT_EQ(ladder.verdict, engine::Verdict::kUnexplained);
  EXPECT_TRUE(ladder.steps.empty());
  ASSERT_TRUE(ladder.unexplained.has_value());
  EXPECT_THAT(ladder.unexplained->words, HasSubstr("by about 0.2 mm along x"));
}

TEST(PoseScatter, IsNamedBesideNoiseThatSaysTheSame) {
  touches::NoiseFindings noise;
  const DiagnosisInput input = WithPlay("0.2,0,0", "-0.2,0,0");
  auto workspace = MakeWorkspace(input, {});
  ASSERT_TRUE(workspace.ok()) << workspace.status();
  const touches::Observations& o = *(*workspace)->observations;
  const std::vector<double> residuals = touches::Residuals(o, (*workspace)->nominal);
  const auto alone = FindPoseScatter(o, (*workspace)->nominal, residuals, noise);
  ASSERT_TRUE(alone.has_value());
  EXPECT_TRUE(alone->ahead);
  noise.slope.gain_nats = alone->gain_nats + 1;
  const auto beside = FindPoseScatter(o, (*workspace)->nominal, residuals, noise);
  ASSERT_TRUE(beside.has_value());
  EXPECT_FALSE(beside->ahead);
  EXPECT_THAT(beside->words, HasSubstr("about as well"));
  noise.slope.gain_nats = alone->gain_nats + 10;
  EXPECT_FALSE(FindPoseScatter(o, (*workspace)->nominal, residuals, noise).has_value());
}

// Slow: three whole diagnoses, of sets large enough to tell the kinds of scatter apart.
TEST(PoseScatter, NoiseOfTheFingersKeepsItsName) {
  for (const Effects& noise : std::vector<Effects>{{{"incidence_noise", {"slope=1"}}},
                                                   {{"finger_noise", {"sigma_us=5000,0,0"}}},
                                                   {{"heavy_tail_noise", {"degrees_of_freedom=3"}}}}) {
    SCOPED_TRACE(noise[0].first);
    const Ladder ladder = LadderOf(touches::MakeTestInput(RigWith(noise)));
    ASSERT_EQ(ladder.steps.size(), 1u);
    EXPECT_EQ(ladder.steps[0].effect, noise[0].first);
    if (ladder.unexplained) {
      EXPECT_THAT(ladder.unexplained->words, Not(HasSubstr("Repeats scatter as if")));
    }
  }
}

TEST(PoseScatter, IsNotClaimedOfPlainNoise) {
  for (uint64_t seed = 1; seed <= 2; ++seed) {
    touches::HiddenRig rig = RigWith({});
    rig.seed = seed;
    EXPECT_EQ(LadderOf(touches::MakeTestInput(rig)).verdict, engine::Verdict::kAdequate) << seed;
  }
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
