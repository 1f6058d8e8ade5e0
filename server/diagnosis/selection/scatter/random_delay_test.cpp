#include "server/diagnosis/selection/scatter/random_delay.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "server/base/numbers/random.h"

namespace touchstone::diagnosis::selection {
namespace {

using ::testing::HasSubstr;
using ReadingOf = std::function<double(RandomStream&, int finger, double slowness)>;

struct Searched {
  touches::NoiseFindings noise;
  std::optional<RandomDelay> delay;
};

// Touches of three fingers whose readings are drawn one by one; every other touch at a third of the speed.
Searched Search(uint64_t seed, int touches, const ReadingOf& reading_s) {
  RandomStream random(seed, RandomDomain::kTest);
  touches::NoiseSample sample;
  sample.channels = 3;
  sample.size = touches;
  sample.rms_slowness_s_per_m = 50;
  for (int k = 0; k < touches; ++k) {
    touches::ReadingGroup group;
    group.index = k;
    group.slowness = k % 2 == 0 ? 0.45 : 1.34;
    for (int i = 0; i < 3; ++i) {
      group.residual_s.push_back(reading_s(random, i, group.slowness));
      group.growth.push_back(0.3);
      group.channel.push_back(i);
    }
    sample.groups.push_back(group);
  }
  Searched searched;
  searched.noise = touches::FindNoise(sample, 0);
  searched.delay = FindRandomDelay(sample, searched.noise, 3);
  return searched;
}

double Exponential(RandomStream& random) {
  return -std::log(1 - random.Uniform());
}

TEST(RandomDelay, OneOfTwoValuesIsSeen) {
  const Searched found = Search(1, 240, [](RandomStream& random, int, double) {
    return 0.004 * random.Normal() + (random.Uniform() < 0.3 ? 0.015 : 0);
  });
  ASSERT_TRUE(found.delay.has_value());
  EXPECT_EQ(found.delay->noise.shape, DelayShape::kTwoValues);
  EXPECT_EQ(found.delay->noise.finger, -1);
  EXPECT_FALSE(found.delay->noise.of_length);
  EXPECT_NEAR(found.delay->noise.size, 0.015, 0.0015);
  EXPECT_NEAR(found.delay->noise.share, 0.3, 0.08);
  EXPECT_NEAR(found.delay->sigma_s.value, 0.004, 0.0006);
  EXPECT_THAT(found.delay->words, HasSubstr("take one of two values"));
  EXPECT_THAT(found.delay->words, HasSubstr("later than the others"));
  // The spread of both values together is no normal noise.
  EXPECT_GT(found.noise.sigma_s.value, 0.007);
  EXPECT_NEAR(WithoutDelays(*found.delay, found.noise).sigma_s.value, 0.004, 0.0006);
}

TEST(RandomDelay, TheOneFingerThatIsLateIsNamed) {
  const Searched found = Search(2, 400, [](RandomStream& random, int finger, double) {
    return 0.004 * random.Normal() + (finger == 1 && random.Uniform() < 0.5 ? 0.016 : 0);
  });
  ASSERT_TRUE(found.delay.has_value());
  EXPECT_EQ(found.delay->noise.finger, 1);
  EXPECT_THAT(found.delay->words, HasSubstr("The times of finger m take one of two values"));
  // One finger that scatters more is no kind of noise beside it.
  EXPECT_TRUE(WithoutDelays(*found.delay, found.noise).channel_sigma_s.empty());
}

TEST(RandomDelay, ADelayOfTheTravelIsToldFromOneOfTheTime) {
  const Searched found = Search(3, 300, [](RandomStream& random, int, double slowness) {
    return 0.003 * random.Normal() + (random.Uniform() < 0.3 ? 0.0002 * 50 * slowness : 0);
  });
  ASSERT_TRUE(found.delay.has_value());
  EXPECT_TRUE(found.delay->noise.of_length);
  EXPECT_NEAR(found.delay->length_m, 0.0002, 0.00003);
  EXPECT_THAT(found.delay->words, HasSubstr("% come 0.2 mm of the travel later than"));
}

TEST(RandomDelay, ItsShapeIsNamed) {
  const Searched late = Search(4, 600, [](RandomStream& random, int, double) {
    return 0.003 * random.Normal() + 0.012 * Exponential(random);
  });
  ASSERT_TRUE(late.delay.has_value());
  EXPECT_EQ(late.delay->noise.shape, DelayShape::kLate);
  EXPECT_NEAR(late.delay->noise.size, 0.012, 0.0015);
  EXPECT_THAT(late.delay->words, HasSubstr("come late by an amount that is exponentially distributed"));
  const Searched early = Search(5, 600, [](RandomStream& random, int, double) {
    return 0.003 * random.Normal() - 0.012 * Exponential(random);
  });
  ASSERT_TRUE(early.delay.has_value());
  EXPECT_EQ(early.delay->noise.shape, DelayShape::kEarly);
  const Searched even = Search(6, 600, [](RandomStream& random, int, double) {
    return 0.002 * random.Normal() + 0.030 * random.Uniform();
  });
  ASSERT_TRUE(even.delay.has_value());
  EXPECT_EQ(even.delay->noise.shape, DelayShape::kUniform);
  EXPECT_NEAR(even.delay->noise.size, 0.030, 0.003);
  EXPECT_THAT(even.delay->words, HasSubstr("spread evenly over"));
}

// Noise of the catalogue: normal, of lengths, of one finger, heavy-tailed, a few gross errors.
TEST(RandomDelay, NoiseOfTheCatalogueHasNone) {
  for (uint64_t seed = 10; seed < 13; ++seed) {
    EXPECT_FALSE(
        Search(seed, 240, [](RandomStream& random, int, double) { return 0.005 * random.Normal(); }).delay)
        << seed;
    EXPECT_FALSE(Search(seed, 240,
                        [](RandomStream& random, int finger, double slowness) {
                          return 0.003 * (1 + finger) * slowness * random.Normal();
                        })
                     .delay)
        << seed;
    EXPECT_FALSE(Search(seed, 240,
                        [](RandomStream& random, int, double) {
                          return 0.004 * random.Normal() / std::sqrt(Exponential(random));
                        })
                     .delay)
        << seed;
    EXPECT_FALSE(Search(seed, 240,
                        [](RandomStream& random, int, double) {
                          return (random.Uniform() < 0.02 ? 0.100 : 0.005) * random.Normal();
                        })
                     .delay)
        << seed;
  }
}

TEST(RandomDelay, LikelihoodOfTwoValuesIsTheSameInClosedFormAndIntegrated) {
  RandomStream random(8, RandomDomain::kTest);
  std::vector<touches::ReadingGroup> groups;
  for (int k = 0; k < 80; ++k) {
    touches::ReadingGroup group{k, {}, {0.1, 0.4, 1.0}, {0, 1, 2}, 0.6 + 0.01 * k};
    for (int i = 0; i < 3; ++i)
      group.residual_s.push_back(0.004 * random.Normal() + (random.Uniform() < 0.4 ? 0.012 : 0));
    groups.push_back(group);
  }
  touches::NoiseModel scales;
  scales.slope = 0.5;
  for (const int finger : {-1, 2})
    for (const bool of_length : {false, true}) {
      const TwoValues found = FitTwoValues(groups, scales, finger, of_length);
      touches::NoiseModel none = scales;
      const double closed = touches::ProfileSigma(groups, &none) + found.gain_nats;
      EXPECT_NEAR(DelayedLogLikelihood(groups, scales, found.noise), closed, 0.05) << finger << of_length;
    }
}

TEST(RandomDelay, TwoFingersSayNothing) {
  touches::NoiseSample sample;
  RandomStream random(7, RandomDomain::kTest);
  for (int k = 0; k < 300; ++k)
    sample.groups.push_back(
        {k, {random.Uniform() < 0.5 ? 0.02 : 0.0, 0.001 * random.Normal()}, {0, 0}, {0, 1}, 1});
  EXPECT_FALSE(FindRandomDelay(sample, {}, 2).has_value());
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
