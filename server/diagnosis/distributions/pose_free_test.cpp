#include "server/diagnosis/distributions/pose_free.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/test_tier.h"
#include "server/diagnosis/distributions/pose_free_test_set.h"

namespace touchstone::diagnosis::distributions {
namespace {

std::vector<std::string> NamesOf(const std::vector<CompatibleEffect>& effects) {
  std::vector<std::string> names;
  for (const CompatibleEffect& effect : effects) names.push_back(effect.effect);
  return names;
}

TEST(PoseFree, UnderTheRightModelEveryPIsEquallyProbable) {
  TOUCHSTONE_SECOND_TIER("statistical: a distribution over many sets");
  int below_tenth = 0, below_half = 0, energy_below_tenth = 0;
  const int sets = 40;
  for (int seed = 0; seed < sets; ++seed) {
    DiagnosisInput input = MakePoseFreeInput(WedgeModel(kWedgeNoise), 4, 3, seed);
    input.seed = seed;
    const auto comparison = ComparePoseFree(input, {}, false);
    ASSERT_TRUE(comparison.ok()) << comparison.status();
    below_tenth += comparison->p_value <= 0.1;
    below_half += comparison->p_value <= 0.5;
    energy_below_tenth += comparison->energy_p_value <= 0.1;
  }
  EXPECT_NEAR(below_half, 0.5 * sets, 3 * std::sqrt(0.25 * sets));
  EXPECT_NEAR(below_tenth, 0.1 * sets, 3 * std::sqrt(0.09 * sets));
  EXPECT_NEAR(energy_below_tenth, 0.1 * sets, 3 * std::sqrt(0.09 * sets));
}

TEST(PoseFree, ARightModelIsCompatible) {
  const auto comparison =
      ComparePoseFree(MakePoseFreeInput(WedgeModel(kWedgeNoise), 8, 4, 3, kWedgeNoise, 2), {}, true);
  ASSERT_TRUE(comparison.ok()) << comparison.status();
  EXPECT_TRUE(comparison->compatible);
  EXPECT_EQ(comparison->rows.compared, 384);
  ASSERT_TRUE(comparison->noise.has_value());
  EXPECT_NEAR(comparison->noise->sigma_s, 0.005, 0.0006);
  EXPECT_THAT(comparison->compatible_effects, testing::IsEmpty());
  EXPECT_GT(comparison->simulated_touches, 1000);
  EXPECT_THAT(comparison->plan, testing::HasSubstr("8 poses per face, 4 touches per pose"));
  double fractions = 0;
  for (const StatisticComparison& statistic : comparison->statistics)
    if (statistic.name.substr(0, 6) == "finger") fractions += statistic.measured;
  EXPECT_NEAR(fractions, 1, 1e-9);
}

TEST(PoseFree, AGrossErrorIsFoundWithWhatIsCompatibleAndNoCulpritIsNamed) {
  TOUCHSTONE_SECOND_TIER("long: all permutations of a large set");
  const auto wrong =
      WedgeModel(std::string(kWedgeNoise) + "  - finger_length: {offset_mm: [1, -0.5, -0.5]}\n");
  int calls = 0;
  DiagnosisContext context;
  context.progress = [&](const std::string&, double) {
    ++calls;
    return true;
  };
  const auto comparison = ComparePoseFree(MakePoseFreeInput(wrong, 16, 2, 4, kWedgeNoise, 2), context, true);
  ASSERT_TRUE(comparison.ok()) << comparison.status();
  EXPECT_FALSE(comparison->compatible);
  EXPECT_LT(comparison->p_value, 0.005);
  EXPECT_THAT(NamesOf(comparison->compatible_effects), testing::Contains("finger_length"));
  // At one speed a latency is the same as a length.
  EXPECT_THAT(NamesOf(comparison->compatible_effects), testing::Contains("channel_latency"));
  EXPECT_THAT(NamesOf(comparison->compatible_effects), testing::Not(testing::Contains("gaussian_noise")));
  EXPECT_EQ(comparison->noise_change, NoiseChange::kNone);
  EXPECT_GT(calls, 30);  // progress is reported many times a second
}

TEST(PoseFree, PosesThatAreNotTheUsualOnesAreFittedNeitherBlamedNorInTheWayOfAnError) {
  TOUCHSTONE_SECOND_TIER("statistical: several sets");
  DiagnosisInput input = MakePoseFreeInput(WedgeModel(kWedgeNoise), 16, 2, 11, kWedgeNoise, 2, {0.6, 0.8});
  auto comparison = ComparePoseFree(input, {}, true);
  ASSERT_TRUE(comparison.ok()) << comparison.status();
  EXPECT_TRUE(comparison->compatible);
  EXPECT_THAT(comparison->plan, testing::HasSubstr("what fits best"));

  const auto wrong =
      WedgeModel(std::string(kWedgeNoise) + "  - finger_length: {offset_mm: [1, -0.5, -0.5]}\n");
  comparison = ComparePoseFree(MakePoseFreeInput(wrong, 16, 2, 11, kWedgeNoise, 2, {0.6, 0.8}), {}, true);
  ASSERT_TRUE(comparison.ok()) << comparison.status();
  EXPECT_FALSE(comparison->compatible);
  EXPECT_THAT(NamesOf(comparison->compatible_effects), testing::Contains("finger_length"));
}

TEST(PoseFree, MissingNoiseIsNamedWithItsSizeFromTheRounds) {
  const auto comparison =
      ComparePoseFree(MakePoseFreeInput(WedgeModel(kWedgeNoise), 8, 8, 5, "", 2), {}, true);
  ASSERT_TRUE(comparison.ok()) << comparison.status();
  EXPECT_TRUE(comparison->compatible);
  EXPECT_EQ(comparison->noise_change, NoiseChange::kNewEffect);
  ASSERT_TRUE(comparison->noise.has_value());
  EXPECT_NEAR(comparison->noise->sigma_s, 0.005, 4 * comparison->noise->std_error_s);
  EXPECT_THAT(model::FormatModel(*comparison->model), testing::HasSubstr("gaussian_noise"));
}

TEST(PoseFree, TimesInTheWrongUnitHaveAnAbsurdSize) {
  DiagnosisInput input = MakePoseFreeInput(WedgeModel(kWedgeNoise), 4, 2, 6);
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  for (double& time_s : set->time_s) time_s *= 1000;
  input.set = set;
  const auto comparison = ComparePoseFree(input, {}, false);
  ASSERT_TRUE(comparison.ok()) << comparison.status();
  EXPECT_GT(comparison->size_ratio, 100);
}

TEST(PoseFree, RowsWithAMissingFingerAreCounted) {
  DiagnosisInput input = MakePoseFreeInput(WedgeModel(kWedgeNoise), 4, 3, 7);
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  for (const int row : {3, 9, 40}) set->time_s[row * 3 + 1] = NAN;
  input.set = set;
  const auto comparison = ComparePoseFree(input, {}, false);
  ASSERT_TRUE(comparison.ok()) << comparison.status();
  EXPECT_EQ(comparison->rows.compared, 69);
  EXPECT_EQ(comparison->rows.missed_contacts, 3);
  EXPECT_EQ(comparison->rows.incomplete, 3);
  EXPECT_EQ(comparison->rows.thinned, 0);
  EXPECT_THAT(comparison->rows.incomplete_examples, testing::ElementsAre(3, 9, 40));
}

TEST(PoseFree, AnObjectWithoutAMeshAndAWrongNumberOfFingersAreErrors) {
  DiagnosisInput input = MakePoseFreeInput(WedgeModel(kWedgeNoise), 4, 2, 8);
  input.surfaces.clear();
  EXPECT_THAT(std::string(ComparePoseFree(input, {}, false).status().message()),
              testing::HasSubstr("object 'wedge0' has no mesh"));
  input = MakePoseFreeInput(WedgeModel(kWedgeNoise), 4, 2, 8);
  auto model = std::make_shared<model::Model>(*input.model);
  model->fingers = 4;
  input.model = model;
  EXPECT_THAT(std::string(ComparePoseFree(input, {}, false).status().message()),
              testing::HasSubstr("times of 3 fingers, the model 'nominal' has 4"));
}

TEST(PoseFree, IsCancelledAtEveryStageAndGivesTheSameOnAnyNumberOfThreads) {
  TOUCHSTONE_SECOND_TIER("long: a diagnosis per number of threads");
  const auto wrong = WedgeModel(std::string(kWedgeNoise) + "  - finger_length: {offset_mm: [2, -1, -1]}\n");
  const DiagnosisInput input = MakePoseFreeInput(wrong, 6, 3, 9);
  for (const char* at : {"simulating sets", "fitting the poses' spread", "trying effects"}) {
    DiagnosisContext stop;
    std::string last;
    stop.progress = [&](const std::string& stage, double done) {
      last = stage;
      return stage != at;
    };
    EXPECT_EQ(ComparePoseFree(input, stop, true).status().code(), absl::StatusCode::kCancelled) << at;
    EXPECT_EQ(last, at);  // nothing was asked after the refusal
  }
  ThreadPool pool(2);
  DiagnosisContext threads;
  threads.pool = &pool;
  double before = 0;
  threads.progress = [&](const std::string&, double done) {
    EXPECT_GE(done, before);
    before = done;
    return done <= 1;
  };
  const auto comparison = ComparePoseFree(input, threads, true);
  ASSERT_TRUE(comparison.ok()) << comparison.status();
  EXPECT_FALSE(comparison->compatible);
  EXPECT_EQ(before, 1);
  const auto alone = ComparePoseFree(input, {}, true);
  ASSERT_TRUE(alone.ok()) << alone.status();
  EXPECT_EQ(alone->p_value, comparison->p_value);
  EXPECT_EQ(alone->energy_distance_s, comparison->energy_distance_s);
  EXPECT_EQ(alone->plan, comparison->plan);
  ASSERT_EQ(alone->histograms.size(), comparison->histograms.size());
  for (size_t n = 0; n < alone->histograms.size(); ++n)
    EXPECT_EQ(alone->histograms[n].simulated, comparison->histograms[n].simulated);
  ASSERT_EQ(alone->compatible_effects.size(), comparison->compatible_effects.size());
  for (size_t n = 0; n < alone->compatible_effects.size(); ++n) {
    EXPECT_EQ(alone->compatible_effects[n].effect, comparison->compatible_effects[n].effect);
    EXPECT_EQ(alone->compatible_effects[n].values, comparison->compatible_effects[n].values);
    EXPECT_EQ(alone->compatible_effects[n].p_value, comparison->compatible_effects[n].p_value);
  }
}

}  // namespace
}  // namespace touchstone::diagnosis::distributions
