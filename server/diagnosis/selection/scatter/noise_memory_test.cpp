#include "server/diagnosis/selection/scatter/noise_memory.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/numbers/random.h"

namespace touchstone::diagnosis::selection {
namespace {

// 960 touches ten seconds apart: noise of 5 ms, and on each finger a course of the session.
struct CourseOfSession {
  touches::Observations o;
  std::vector<double> residuals;

  template <typename CourseOf>
  CourseOfSession(uint64_t seed, CourseOf course) {
    auto set = std::make_shared<session::MeasurementSet>();
    set->has_session_time = true;
    o.fingers = 3;
    RandomStream random(seed, RandomDomain::kTest);
    for (int k = 0; k < 960; ++k) {
      set->session_time_s.push_back(10.0 * k);
      o.row.push_back(k);
      o.used.push_back(1);
      double r[3], mean = 0;
      for (int i = 0; i < 3; ++i) r[i] = 0.005 * random.Normal() + course(k, i, &random);
      for (const double value : r) mean += value / 3;
      for (const double value : r) residuals.push_back(value - mean);
    }
    o.set = set;
  }
};

TEST(NoiseMemory, FindsSizeAndCorrelationTime) {
  double state[3] = {0, 0, 0};
  const CourseOfSession session(3, [&state](int, int i, RandomStream* random) {
    const double rho = std::exp(-10.0 / 300);
    state[i] = rho * state[i] + 0.007 * std::sqrt(1 - rho * rho) * random->Normal();
    return state[i];
  });
  const auto found = FindNoiseMemory(session.o, session.residuals);
  ASSERT_TRUE(found);
  EXPECT_GT(found->gain_nats, 100);
  EXPECT_NEAR(found->sigma_s.value, 0.007, 4 * found->sigma_s.std_error);
  EXPECT_NEAR(std::log(found->time_s.value / 300), 0, 4 * found->time_s.std_error / found->time_s.value);
  EXPECT_NEAR(found->white_s.value, 0.005, 3e-4);
  EXPECT_TRUE(found->everywhere);
  EXPECT_GT(found->gain_nats, found->step_gain_nats + 20);
  EXPECT_GT(found->gain_nats, found->smooth_gain_nats + 3);
  EXPECT_GT(found->gain_nats, found->period_gain_nats + 20);
}

TEST(NoiseMemory, ACourseWithCornersThatRepeatsIsNoCorrelatedNoise) {
  const CourseOfSession session(
      5, [](int k, int i, RandomStream*) { return i == 0 ? 0.020 * std::fmod(10.0 * k, 600) / 600 : 0.0; });
  const auto found = FindNoiseMemory(session.o, session.residuals);
  ASSERT_TRUE(found);
  EXPECT_GT(found->gain_nats, found->smooth_gain_nats + 3)
      << "its corners make it rougher than a smooth course";
  EXPECT_GT(found->period_gain_nats, found->gain_nats + 20);
}

TEST(NoiseMemory, ARandomWalkDoesNotRevertAndCorrelatedNoiseDoes) {
  int walks = 0;
  for (uint64_t seed = 20; seed < 30; ++seed) {
    double walked[3] = {0, 0, 0}, correlated[3] = {0, 0, 0};
    const CourseOfSession walk(
        seed, [&walked](int, int i, RandomStream* random) { return walked[i] += 0.0008 * random->Normal(); });
    walks += !RevertsToMean(*FindNoiseMemory(walk.o, walk.residuals));
    const CourseOfSession reverting(seed, [&correlated](int, int i, RandomStream* random) {
      const double rho = std::exp(-10.0 / 300);
      return correlated[i] = rho * correlated[i] + 0.007 * std::sqrt(1 - rho * rho) * random->Normal();
    });
    EXPECT_TRUE(RevertsToMean(*FindNoiseMemory(reverting.o, reverting.residuals))) << seed;
  }
  EXPECT_GE(walks, 9);
}

TEST(NoiseMemory, GainsNothingOfUncorrelatedNoise) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const CourseOfSession session(seed, [](int, int, RandomStream*) { return 0.0; });
    EXPECT_LT(FindNoiseMemory(session.o, session.residuals)->gain_nats, 2);
  }
}

TEST(NoiseMemory, APeriodAndAWarmUpAreSmootherThanCorrelatedNoise) {
  for (const double amplitude_s : {0.006, 0.025}) {
    const CourseOfSession period(6, [=](int k, int i, RandomStream*) {
      return (i - 1) * amplitude_s * std::sin(2 * kPi * 10.0 * k / 1024);
    });
    const auto found = FindNoiseMemory(period.o, period.residuals);
    EXPECT_GT(found->smooth_gain_nats, found->gain_nats) << amplitude_s;
    const CourseOfSession warm_up(7, [=](int k, int i, RandomStream*) {
      return i == 1 ? amplitude_s * std::exp(-10.0 * k / 1000) : 0;
    });
    const auto levelled = FindNoiseMemory(warm_up.o, warm_up.residuals);
    EXPECT_GT(levelled->smooth_gain_nats, levelled->gain_nats - 3) << amplitude_s;
  }
}

TEST(NoiseMemory, ASingleStepIsNoCorrelatedNoise) {
  const CourseOfSession session(4,
                                [](int k, int i, RandomStream*) { return i == 1 && k > 400 ? 0.0125 : 0.0; });
  const auto found = FindNoiseMemory(session.o, session.residuals);
  EXPECT_GT(found->step_gain_nats, found->gain_nats);
}

TEST(NoiseMemory, AnEventIsNoCorrelatedNoise) {
  const CourseOfSession session(
      5, [](int k, int i, RandomStream*) { return i == 0 && k > 500 && k < 570 ? 0.012 : 0.0; });
  EXPECT_FALSE(FindNoiseMemory(session.o, session.residuals)->everywhere);
}

TEST(DeclaredMemory, IsAbsentWhereThereIsNoiseWithoutMemoryOnly) {
  for (uint64_t seed = 20; seed < 24; ++seed) {
    const CourseOfSession session(seed, [](int, int, RandomStream*) { return 0.0; });
    EXPECT_TRUE(AssessDeclaredMemory(session.o, session.residuals, 0.007, 300).absent);
    // These data could not show them.
    EXPECT_FALSE(AssessDeclaredMemory(session.o, session.residuals, 0.0001, 300).absent);
    EXPECT_FALSE(AssessDeclaredMemory(session.o, session.residuals, 0.007, 9000).absent);
  }
}

TEST(DeclaredMemory, IsNeitherAbsentNorAnotherWhereItIs) {
  for (uint64_t seed = 30; seed < 34; ++seed) {
    double state[3] = {0, 0, 0};
    const CourseOfSession session(seed, [&state](int, int i, RandomStream* random) {
      const double rho = std::exp(-10.0 / 300);
      state[i] = rho * state[i] + 0.004 * std::sqrt(1 - rho * rho) * random->Normal();
      return state[i];
    });
    EXPECT_FALSE(AssessDeclaredMemory(session.o, session.residuals, 0.004, 300).absent);
    EXPECT_FALSE(AssessDeclaredMemory(session.o, session.residuals, 0.004, 300).other);
    EXPECT_TRUE(AssessDeclaredMemory(session.o, session.residuals, 0.012, 300).other);
    EXPECT_TRUE(AssessDeclaredMemory(session.o, session.residuals, 0.004, 15).other);
  }
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
