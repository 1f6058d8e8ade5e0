#include "server/diagnosis/touches/noise_sample.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::touches {
namespace {

constexpr double kSigma = 0.005;

template <typename Draw>
inference::NoiseFindings FindIn(Draw draw, uint64_t seed = 3) {
  SyntheticSet set(5, 48, 4, 0, seed);
  std::vector<double> tangents(set.observations.time_s.size());
  for (size_t e = 0; e < tangents.size(); ++e) {
    tangents[e] =
        std::tan(set.IncidenceDeg(static_cast<int>(e / 3), static_cast<int>(e % 3)) * kRadiansPerDegree);
    set.observations.time_s[e] += draw(tangents[e]);
  }
  set.Finish();
  return inference::FindNoise(
      MakeNoiseSample(set.observations, set.residuals, tangents, std::vector<char>(tangents.size(), 1)), 0);
}

TEST(FindNoise, MeasuresPlainNoiseAndClaimsNothingElse) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0, kSigma);
  const inference::NoiseFindings found = FindIn([&](double) { return normal(random); });
  EXPECT_NEAR(found.sigma_s.value, kSigma, 4 * found.sigma_s.std_error);
  EXPECT_EQ(found.slope.gain_nats, 0);
  EXPECT_EQ(found.degrees_of_freedom.gain_nats, 0);
  EXPECT_EQ(found.poll_interval_s.gain_nats, 0);
  EXPECT_EQ(found.missed_probability.gain_nats, 0);
  EXPECT_TRUE(found.outliers.empty());
}

TEST(FindNoise, MeasuresHeavyTails) {
  std::mt19937_64 random(2);
  std::student_t_distribution<double> student(3);
  const inference::NoiseFindings found = FindIn([&](double) { return kSigma * student(random); });
  EXPECT_NEAR(found.degrees_of_freedom.value, 3, 3 * found.degrees_of_freedom.std_error);
  EXPECT_NEAR(found.sigma_s.value, kSigma, 0.1 * kSigma);
  EXPECT_FALSE(found.weights.empty());
}

TEST(FindNoise, MeasuresNoiseThatGrowsOnSlopes) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0, kSigma);
  const inference::NoiseFindings found =
      FindIn([&](double tangent) { return (1 + 3 * tangent) * normal(random); });
  EXPECT_NEAR(found.slope.value, 3, 4 * found.slope.std_error);
  EXPECT_EQ(found.degrees_of_freedom.gain_nats, 0);
}

TEST(FindNoise, TellsOutliersFromHeavyTails) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal(0, kSigma);
  int drawn = 0;
  const inference::NoiseFindings found =
      FindIn([&](double) { return ++drawn % 150 == 0 ? 0.2 : normal(random); });
  EXPECT_EQ(found.degrees_of_freedom.gain_nats, 0);
  EXPECT_EQ(found.outliers.size(), 960u * 3 / 150);
}

TEST(FindNoise, FindsTheTicksOfAPollingLoop) {
  SyntheticSet set(3, 20, 2, kSigma, 5);
  for (double& time_s : set.observations.time_s) time_s = std::ceil(time_s / 0.0125) * 0.0125;
  set.Finish();
  const std::vector<double> tangents(set.residuals.size(), 0.1);
  const inference::NoiseFindings found = inference::FindNoise(
      MakeNoiseSample(set.observations, set.residuals, tangents, std::vector<char>(tangents.size(), 1)), 0);
  EXPECT_NEAR(found.poll_interval_s.value, 0.0125, 1e-8);
}

TEST(FindNoise, CountsContactsThatAreMissed) {
  SyntheticSet set(3, 20, 2, kSigma, 6);
  for (size_t e = 0; e < set.observations.time_s.size(); e += 11) set.observations.time_s[e] = NAN;
  set.Finish();
  const std::vector<double> tangents(set.residuals.size(), 0.1);
  const inference::NoiseFindings found = inference::FindNoise(
      MakeNoiseSample(set.observations, set.residuals, tangents, std::vector<char>(tangents.size(), 1)), 0);
  EXPECT_NEAR(found.missed_probability.value, 1.0 / 11, 0.01);
}

TEST(FindNoise, AFingerThatIsSilentInEveryRepeatIsOutOfReachAndNoChance) {
  SyntheticSet set(3, 20, 4, kSigma, 6);
  const Observations& o = set.observations;
  for (int k = 0; k < o.size(); ++k)
    if (o.pose[k] % 10 == 0) set.observations.time_s[static_cast<size_t>(k) * o.fingers + 2] = NAN;
  set.Finish();
  const std::vector<double> tangents(set.residuals.size(), 0.1);
  const inference::NoiseFindings found = inference::FindNoise(
      MakeNoiseSample(set.observations, set.residuals, tangents, std::vector<char>(tangents.size(), 1)), 0);
  EXPECT_EQ(found.missed_probability.gain_nats, 0) << found.missed_probability.value;
}

}  // namespace
}  // namespace touchstone::diagnosis::touches
