#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "server/gateway/rig/results/approach_fit.h"

namespace touchstone::gateway {
namespace {

constexpr ApproachProfile kProfile{0.02, 1.2};
constexpr double kBeganS = 100.0007;
// What 2e-5 rad of noise on every joint, as UR's arms tell, make of a tip at 0.3 m.
constexpr double kNoiseM = 7e-6;

struct Draw {
  double from_s = 0, until_s = 3;  // since the approach began
  int states = 1500;               // spread evenly
  double noise_m = kNoiseM;
  double correlation = 0;  // of neighbouring states' noise
  double lag_s = 0;        // first order: the actual speed nears the commanded one with this time constant
  ApproachProfile profile = kProfile;
  std::function<double(double)> bend = nullptr;  // added distance by the time since the start
};

// Where an arm that lags behind its target by a first order is, apart from the lag at constant speed, which is a shift
// of the start: contacts have it too.
double LaggingDistance(const ApproachProfile& profile, double since_s, double lag_s) {
  if (lag_s <= 0 || since_s <= -lag_s) return profile.DistanceAt(since_s);
  const double t = since_s + lag_s, a = profile.acceleration_m_s2, ramp_s = profile.RampS();
  const auto ramp = [&](double x) {
    return x <= 0 ? 0 : a * (x * x / 2 - lag_s * x + lag_s * lag_s * (1 - std::exp(-x / lag_s)));
  };
  return ramp(t) - ramp(t - ramp_s);
}

std::vector<ApproachState> Recording(const Draw& draw, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> part(0, 1);
  const double phase = part(random);
  double noise = normal(random);
  std::vector<ApproachState> states;
  for (int k = 0; k < draw.states; ++k) {
    const double since_s = draw.from_s + (draw.until_s - draw.from_s) * (k + phase) / draw.states;
    double distance_m = LaggingDistance(draw.profile, since_s, draw.lag_s) + draw.noise_m * noise;
    if (draw.bend) distance_m += draw.bend(since_s);
    states.push_back({kBeganS + since_s, distance_m});
    noise = draw.correlation * noise + std::sqrt(1 - draw.correlation * draw.correlation) * normal(random);
  }
  return states;
}

struct Figures {
  double within_2 = 0, worst = 0;  // share of draws; largest error over what was stated
  double median_us = 0, p99_us = 0, bias_us = 0, stated_us = 0;
};

Figures FiguresOf(const Draw& draw, int draws = 2000) {
  Figures figures;
  std::vector<double> sizes_us;
  for (int k = 0; k < draws; ++k) {
    const auto fit =
        FitApproach(Recording(draw, 1 + k), {kProfile.speed_m_s, draw.profile.acceleration_m_s2});
    EXPECT_TRUE(fit.ok()) << k << " " << fit.status();
    if (!fit.ok()) return figures;
    const double error_s = fit->began_s - kBeganS, share = std::abs(error_s) / fit->began_uncertainty_s;
    figures.within_2 += (share < 2) / static_cast<double>(draws);
    figures.worst = std::max(figures.worst, share);
    figures.bias_us += 1e6 * error_s / draws;
    figures.stated_us += 1e6 * fit->began_uncertainty_s / draws;
    sizes_us.push_back(1e6 * std::abs(error_s));
  }
  std::sort(sizes_us.begin(), sizes_us.end());
  figures.median_us = sizes_us[draws / 2], figures.p99_us = sizes_us[draws * 99 / 100];
  std::printf(
      "median %.1f us, 99 %% %.1f us, bias %.2f us, stated %.1f us, within 2 sigma %.1f %%, worst %.2f "
      "sigma\n",
      figures.median_us, figures.p99_us, figures.bias_us, figures.stated_us, 100 * figures.within_2,
      figures.worst);
  return figures;
}

void ExpectHonest(const Figures& figures) {
  EXPECT_GE(figures.within_2, 0.94);
  EXPECT_LT(figures.worst, 4);
}

TEST(ApproachFit, AFullStreamTellsTheStartToTenMicroseconds) {
  const Figures figures = FiguresOf(Draw());
  ExpectHonest(figures);
  EXPECT_LT(figures.median_us, 8);
  EXPECT_LT(figures.p99_us, 26);
  EXPECT_LE(figures.within_2, 0.975) << "what is stated is not too much either";
}

TEST(ApproachFit, TwentyStatesTellItAndSayHowWell) {
  Draw draw;
  draw.states = 20;
  const Figures figures = FiguresOf(draw);
  ExpectHonest(figures);
  EXPECT_LT(figures.p99_us, 250);
}

TEST(ApproachFit, FiveStatesAreEnoughForAnHonestAnswer) {
  Draw draw;
  draw.from_s = 0.1;
  for (const int states : {5, 6, 8, 12}) {
    draw.states = states;
    ExpectHonest(FiguresOf(draw));
  }
}

TEST(ApproachFit, StatesOfTheLastMomentsAreNotExtrapolated) {
  Draw draw;
  draw.from_s = 2.8, draw.states = 100;
  const Figures figures = FiguresOf(draw);
  ExpectHonest(figures);
  EXPECT_LT(figures.p99_us, 110);
}

TEST(ApproachFit, NeighboursThatErrAlikeAreNotCountedTwice) {
  Draw draw;
  draw.correlation = 0.9;
  ExpectHonest(FiguresOf(draw));
}

TEST(ApproachFit, ALagOfTheArmBehindItsTargetIsAShiftThatContactsHaveToo) {
  for (const double lag_s : {0.0005, 0.005}) {
    Draw draw;
    draw.lag_s = lag_s;
    const Figures figures = FiguresOf(draw, 500);
    ExpectHonest(figures);
    EXPECT_LT(std::abs(figures.bias_us), 3) << lag_s;
  }
}

TEST(ApproachFit, AFastApproachIsMostlyRampAndIsUsedWhole) {
  Draw draw;
  draw.profile = {0.02, 0.02};  // one second of ramp
  draw.until_s = 1.5, draw.states = 750;
  const Figures figures = FiguresOf(draw);
  ExpectHonest(figures);
  draw.from_s = 1.0, draw.states = 250;
  EXPECT_GT(FiguresOf(draw).median_us, 1.15 * figures.median_us) << "the ramp's states say something";
}

TEST(ApproachFit, OutliersAreLeftOut) {
  std::vector<ApproachState> states = Recording(Draw(), 1);
  const auto clean = FitApproach(states, kProfile);
  for (size_t k = 50; k < states.size(); k += 10) states[k].distance_m += 0.002;
  const auto fit = FitApproach(states, kProfile);
  ASSERT_TRUE(clean.ok() && fit.ok()) << fit.status();
  EXPECT_NEAR(fit->began_s, clean->began_s, 5e-6);
}

TEST(ApproachFit, AnotherSpeedIsRefusedWithBothNumbers) {
  Draw draw;
  draw.profile.speed_m_s = 0.019;
  const auto fit = FitApproach(Recording(draw, 1), kProfile);
  ASSERT_EQ(fit.status().code(), absl::StatusCode::kFailedPrecondition) << fit.status();
  EXPECT_THAT(std::string(fit.status().message()),
              testing::AllOf(testing::HasSubstr("19 mm/s"), testing::HasSubstr("20 mm/s")));
}

TEST(ApproachFit, ASpeedThatIsCertainlyALittleOffIsTheMeasuredOne) {
  Draw draw;
  draw.profile.speed_m_s = 0.02 * 1.004;
  const Figures figures = FiguresOf(draw, 500);
  ExpectHonest(figures);
  EXPECT_LT(figures.p99_us, 100);
}

TEST(ApproachFit, AnApproachThatNeverReachedItsSpeedIsRefused) {
  Draw draw;
  draw.profile = {0.02, 0.01};
  draw.until_s = 1.5;
  const auto fit = FitApproach(Recording(draw, 1), {0.02, 0.01});
  ASSERT_EQ(fit.status().code(), absl::StatusCode::kFailedPrecondition) << fit.status();
  EXPECT_THAT(std::string(fit.status().message()), testing::HasSubstr("standoff"));
}

// A CB3 tells 125 states a second: at 50 mm/s one every 0.4 mm, of which 1 mm is ramp. Nobody gains by touching again.
TEST(ApproachFit, AnApproachThatIsTooShortForItsSpeedIsRefusedForGoodIfNoStateIsMissing) {
  Draw draw;
  draw.profile = {0.05, 1.2};
  draw.until_s = 0.08, draw.states = 10;
  std::vector<ApproachState> states = Recording(draw, 1);
  EXPECT_TRUE(NoStateIsMissing(states, draw.profile));
  const absl::Status brief = FitApproach(states, draw.profile, true).status();
  EXPECT_EQ(brief.code(), absl::StatusCode::kFailedPrecondition) << brief;
  EXPECT_THAT(
      std::string(brief.message()),
      testing::AllOf(testing::HasSubstr("4 states"), testing::HasSubstr("lower speed or a longer standoff")));
  states.erase(states.begin() + 7);
  EXPECT_FALSE(NoStateIsMissing(states, draw.profile));
  EXPECT_EQ(FitApproach(states, draw.profile).status().code(), absl::StatusCode::kUnavailable);
  // States of the ramp are no loss, but who saw none of them does not know what else is missing.
  draw.from_s = 0.05;
  EXPECT_FALSE(NoStateIsMissing(Recording(draw, 1), draw.profile));
}

TEST(ApproachFit, TooFewStatesAreRefused) {
  Draw draw;
  for (const int states : {0, 1, 4}) {
    draw.states = states;
    EXPECT_EQ(FitApproach(Recording(draw, 1), kProfile).status().code(), absl::StatusCode::kUnavailable)
        << states;
  }
}

TEST(ApproachFit, StatesWithoutNoiseAreExact) {
  Draw draw;
  draw.noise_m = 0;
  const auto fit = FitApproach(Recording(draw, 1), kProfile);
  ASSERT_TRUE(fit.ok()) << fit.status();
  EXPECT_NEAR(fit->began_s, kBeganS, 1e-9);
  EXPECT_NEAR(fit->speed_m_s, 0.02, 1e-9);
}

}  // namespace
}  // namespace touchstone::gateway
