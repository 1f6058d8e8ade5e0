#include "server/diagnosis/touches/noise/noise_sample.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/base/test_tier.h"
#include "server/diagnosis/touches/synthetic_test_set.h"

namespace touchstone::diagnosis::touches {
namespace {

constexpr double kSigma = 0.005;

template <typename Draw>
NoiseFindings FindIn(Draw draw, uint64_t seed = 3) {
  SyntheticSet set(5, 48, 4, 0, seed);
  std::vector<double> tangents(set.observations.time_s.size());
  for (size_t e = 0; e < tangents.size(); ++e) {
    tangents[e] =
        std::tan(set.IncidenceDeg(static_cast<int>(e / 3), static_cast<int>(e % 3)) * kRadiansPerDegree);
    set.observations.time_s[e] += draw(tangents[e]);
  }
  set.Finish();
  return FindNoise(
      MakeNoiseSample(set.observations, set.residuals, tangents, std::vector<char>(tangents.size(), 1)), 0);
}

TEST(FindNoise, MeasuresPlainNoiseAndClaimsNothingElse) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0, kSigma);
  const NoiseFindings found = FindIn([&](double) { return normal(random); });
  EXPECT_NEAR(found.sigma_s.value, kSigma, 4 * found.sigma_s.std_error);
  EXPECT_EQ(found.slope.gain_nats, 0);
  EXPECT_EQ(found.degrees_of_freedom.gain_nats, 0);
  EXPECT_EQ(found.poll_interval_s.gain_nats, 0);
  EXPECT_EQ(found.missed_probability.gain_nats, 0);
  EXPECT_TRUE(found.outliers.empty());
}

TEST(FindNoise, MeasuresHeavyTails) {
  TOUCHSTONE_SECOND_TIER("statistical: several sets");
  std::mt19937_64 random(2);
  std::student_t_distribution<double> student(3);
  const NoiseFindings found = FindIn([&](double) { return kSigma * student(random); });
  EXPECT_NEAR(found.degrees_of_freedom.value, 3, 3 * found.degrees_of_freedom.std_error);
  EXPECT_NEAR(found.sigma_s.value, kSigma, 0.1 * kSigma);
  EXPECT_FALSE(found.weights.empty());
}

TEST(FindNoise, MeasuresNoiseThatGrowsOnSlopes) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0, kSigma);
  const NoiseFindings found = FindIn([&](double tangent) { return (1 + 3 * tangent) * normal(random); });
  EXPECT_NEAR(found.slope.value, 3, 4 * found.slope.std_error);
  EXPECT_EQ(found.degrees_of_freedom.gain_nats, 0);
}

TEST(FindNoise, TellsOutliersFromHeavyTails) {
  TOUCHSTONE_SECOND_TIER("statistical: several sets");
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal(0, kSigma);
  int drawn = 0;
  const NoiseFindings found = FindIn([&](double) { return ++drawn % 150 == 0 ? 0.2 : normal(random); });
  EXPECT_EQ(found.degrees_of_freedom.gain_nats, 0);
  EXPECT_EQ(found.outliers.size(), 960u * 3 / 150);
}

TEST(FindNoise, FindsTheTicksOfAPollingLoop) {
  SyntheticSet set(3, 20, 2, kSigma, 5);
  for (double& time_s : set.observations.time_s) time_s = std::ceil(time_s / 0.0125) * 0.0125;
  set.Finish();
  const std::vector<double> tangents(set.residuals.size(), 0.1);
  const NoiseFindings found = FindNoise(
      MakeNoiseSample(set.observations, set.residuals, tangents, std::vector<char>(tangents.size(), 1)), 0);
  EXPECT_NEAR(found.poll_interval_s.value, 0.0125, 1e-8);
}

TEST(FindNoise, CountsContactsThatAreMissed) {
  SyntheticSet set(3, 20, 2, kSigma, 6);
  for (size_t e = 0; e < set.observations.time_s.size(); e += 11) set.observations.time_s[e] = NAN;
  set.Finish();
  const std::vector<double> tangents(set.residuals.size(), 0.1);
  const NoiseFindings found = FindNoise(
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
  const NoiseFindings found = FindNoise(
      MakeNoiseSample(set.observations, set.residuals, tangents, std::vector<char>(tangents.size(), 1)), 0);
  EXPECT_EQ(found.missed_probability.gain_nats, 0) << found.missed_probability.value;
}

// Noise drawn by touch and finger, at 10 mm/s in every other round and at 20 mm/s in the rest.
template <typename Draw>
NoiseFindings FindAtTwoSpeeds(Draw draw, const DeclaredNoise& declared = {}) {
  SyntheticSet set(5, 48, 4, 0, 3);
  auto with_speeds = std::make_shared<session::MeasurementSet>(*set.observations.set);
  for (int k = 0; k < set.observations.size(); ++k)
    with_speeds->speed_m_s[k] = set.observations.set->round[k] % 2 == 0 ? 0.01 : 0.02;
  set.observations.set = with_speeds;
  std::vector<double> tangents(set.observations.time_s.size(), 0.1);
  for (size_t e = 0; e < tangents.size(); ++e)
    set.observations.time_s[e] += draw(with_speeds->speed_m_s[e / 3], static_cast<int>(e % 3));
  set.Finish();
  return FindNoise(
      MakeNoiseSample(set.observations, set.residuals, tangents, std::vector<char>(tangents.size(), 1)), 0,
      declared);
}

TEST(FindNoise, ANoiseOfLengthsAtTwoSpeedsIsNoHeavyTail) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal(0, 0.1e-3);
  const NoiseFindings found =
      FindAtTwoSpeeds([&](double speed_m_s, int) { return normal(random) / speed_m_s; });
  EXPECT_EQ(found.degrees_of_freedom.gain_nats, 0);
  EXPECT_GT(found.length_sigma_m.gain_nats, 0);
  EXPECT_NEAR(found.length_sigma_m.value, 0.1e-3, 4 * found.length_sigma_m.std_error);
  EXPECT_TRUE(found.sigma_s.absent) << found.sigma_s.value;
}

TEST(FindNoise, TellsANoiseOfLengthsFromOneOfTimesBesideIt) {
  std::mt19937_64 random(8);
  std::normal_distribution<double> normal(0, 1);
  const NoiseFindings found = FindAtTwoSpeeds(
      [&](double speed_m_s, int) { return 0.08e-3 * normal(random) / speed_m_s + 0.004 * normal(random); });
  EXPECT_NEAR(found.length_sigma_m.value, 0.08e-3, 4 * found.length_sigma_m.std_error);
  EXPECT_LT(found.length_sigma_m.std_error, 0.01e-3);
  EXPECT_NEAR(found.sigma_s.value, 0.004, 4 * found.sigma_s.std_error);
  EXPECT_FALSE(found.sigma_s.absent);
  EXPECT_FALSE(found.weights.empty());
}

TEST(FindNoise, OneLoudFingerIsNoHeavyTail) {
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal(0, kSigma);
  const NoiseFindings found =
      FindAtTwoSpeeds([&](double, int finger) { return (finger == 2 ? 2 : 1) * normal(random); });
  EXPECT_EQ(found.degrees_of_freedom.gain_nats, 0);
  EXPECT_EQ(found.length_sigma_m.gain_nats, 0);
  ASSERT_EQ(found.channel_sigma_s.size(), 3u);
  EXPECT_NEAR(found.sigma_s.value, kSigma, 4 * found.sigma_s.std_error);
  const NoiseEstimate& loud = found.channel_sigma_s[2];
  EXPECT_NEAR(loud.value, std::sqrt(3) * kSigma, 4 * loud.std_error);
  EXPECT_LT(loud.std_error, 0.1 * kSigma);
  // The others are alike.
  EXPECT_EQ(found.channel_sigma_s[0].value, 0);
  EXPECT_EQ(found.channel_sigma_s[1].value, 0);
}

TEST(FindNoise, HeavyTailsAreNoLoudFinger) {
  TOUCHSTONE_SECOND_TIER("statistical: several sets");
  for (const uint64_t seed : {10, 11, 12}) {
    std::mt19937_64 random(seed);
    std::student_t_distribution<double> student(2.5);
    const NoiseFindings found = FindAtTwoSpeeds([&](double, int) { return kSigma * student(random); });
    EXPECT_GT(found.degrees_of_freedom.gain_nats, 0);
    EXPECT_TRUE(found.channel_sigma_s.empty());
    EXPECT_EQ(found.length_sigma_m.gain_nats, 0);
  }
}

// Gaussian noise, under a model that says more of it.
NoiseFindings FindInPlainNoise(const DeclaredNoise& declared) {
  std::mt19937_64 random(13);
  std::normal_distribution<double> normal(0, kSigma);
  return FindAtTwoSpeeds([&](double, int) { return normal(random); }, declared);
}

TEST(FindNoise, SaysThatDeclaredKindsAreNotThere) {
  DeclaredNoise declared;
  declared.sigma_s = kSigma;
  declared.slope = 3;
  declared.degrees_of_freedom = 8;
  declared.poll_interval_s = 0.010;
  declared.missed_probability = 0.01;
  declared.length_sigma_m = 0.05e-3;
  declared.channel_sigma_s = {0, 0, kSigma};
  const NoiseFindings found = FindInPlainNoise(declared);
  EXPECT_TRUE(found.degrees_of_freedom.absent);
  EXPECT_TRUE(found.poll_interval_s.absent);
  EXPECT_TRUE(found.missed_probability.absent);
  EXPECT_TRUE(found.length_sigma_m.absent);
  EXPECT_TRUE(found.channels_absent);
  // Every incidence is the same here: a slope is only another sigma.
  EXPECT_FALSE(found.slope.absent);
}

TEST(FindNoise, ASlopeThatIsNotThereIsAbsent) {
  std::mt19937_64 random(14);
  std::normal_distribution<double> normal(0, kSigma);
  SyntheticSet set(5, 48, 4, 0, 3);
  std::vector<double> tangents(set.observations.time_s.size());
  for (size_t e = 0; e < tangents.size(); ++e) {
    tangents[e] =
        std::tan(set.IncidenceDeg(static_cast<int>(e / 3), static_cast<int>(e % 3)) * kRadiansPerDegree);
    set.observations.time_s[e] += normal(random);
  }
  set.Finish();
  DeclaredNoise declared;
  declared.slope = 1;
  EXPECT_TRUE(FindNoise(MakeNoiseSample(set.observations, set.residuals, tangents,
                                        std::vector<char>(tangents.size(), 1)),
                        0, declared)
                  .slope.absent);
}

TEST(FindNoise, KeepsDeclaredKindsThatAreThere) {
  std::mt19937_64 random(15);
  std::student_t_distribution<double> student(8);
  DeclaredNoise declared;
  declared.degrees_of_freedom = 8;
  const NoiseFindings found =
      FindAtTwoSpeeds([&](double, int) { return kSigma * student(random); }, declared);
  EXPECT_FALSE(found.degrees_of_freedom.absent);
}

TEST(FindNoise, CannotSayThatTicksFinerThanTheFileAreNotThere) {
  DeclaredNoise declared;
  declared.poll_interval_s = 2e-6;
  EXPECT_FALSE(FindInPlainNoise(declared).poll_interval_s.absent);
}

// A sigma from a part of the readings with the error of all of them refits models that are right.
TEST(FindNoise, TheErrorOfSigmaIsThatOfTheReadingsItComesFrom) {
  TOUCHSTONE_SECOND_TIER("statistical: several sets");
  double squares = 0;
  constexpr int kSets = 12;
  for (int j = 0; j < kSets; ++j) {
    std::mt19937_64 random(100 + j);
    std::normal_distribution<double> normal(0, kSigma);
    SyntheticSet set(5, 600, 4, 0, 3);
    for (double& time_s : set.observations.time_s) time_s += normal(random);
    set.Finish();
    const std::vector<double> tangents(set.residuals.size(), 0.1);
    const NoiseFindings found = FindNoise(
        MakeNoiseSample(set.observations, set.residuals, tangents, std::vector<char>(tangents.size(), 1)), 0);
    squares += std::pow((found.sigma_s.value - kSigma) / found.sigma_s.std_error, 2);
  }
  EXPECT_LT(squares / kSets, 2.2);  // chi-squared of 12: one in a hundred
  EXPECT_GT(squares / kSets, 0.25);
}

TEST(FindNoise, FrequentSilenceIsNotTakenForReach) {
  std::mt19937_64 random(16);
  for (const double probability : {0.3, 0.7}) {
    double sum = 0;
    for (int j = 0; j < 8; ++j) {
      SyntheticSet set(3, 40, 4, kSigma, 6 + j);
      for (double& time_s : set.observations.time_s)
        if (std::uniform_real_distribution<double>()(random) < probability) time_s = NAN;
      set.Finish();
      const std::vector<double> tangents(set.residuals.size(), 0.1);
      const NoiseFindings found = FindNoise(
          MakeNoiseSample(set.observations, set.residuals, tangents, std::vector<char>(tangents.size(), 1)),
          0);
      sum += found.missed_probability.value;
    }
    EXPECT_NEAR(sum / 8, probability, 0.02);
  }
}

TEST(FindNoise, SilenceIsCountedBesideFingersOutOfReach) {
  std::mt19937_64 random(17);
  SyntheticSet set(5, 48, 4, kSigma, 6);
  const Observations& o = set.observations;
  for (size_t e = 0; e < set.observations.time_s.size(); ++e) {
    const bool out_of_reach = e % 3 == 2 && o.pose[e / 3] % 5 == 0;
    if (out_of_reach || std::uniform_real_distribution<double>()(random) < 0.4)
      set.observations.time_s[e] = NAN;
  }
  set.Finish();
  const std::vector<double> tangents(set.residuals.size(), 0.1);
  const NoiseFindings found = FindNoise(
      MakeNoiseSample(set.observations, set.residuals, tangents, std::vector<char>(tangents.size(), 1)), 0);
  EXPECT_NEAR(found.missed_probability.value, 0.4, 0.04);
}

}  // namespace
}  // namespace touchstone::diagnosis::touches
