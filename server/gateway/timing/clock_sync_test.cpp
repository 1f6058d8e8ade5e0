#include "server/gateway/timing/clock_sync.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/numbers/random.h"
#include "server/base/sanitizers.h"
#include "server/base/test_tier.h"

namespace touchstone::gateway::timing {
namespace {

// A remote clock at the end of a line, all of it simulated.
struct Line {
  double drift_ppm = 0;
  double drift_change_ppm_per_min = 0;
  double nominal_rate = 1;
  double there_s = 0.0002, back_s = 0.0002;  // shortest delays of both ways
  double jitter_s = 0.005;
  double tail_share = 0, tail_s = 0;  // so many messages are late by an exponential of this mean more
  double lost_share = 0;
  double tick_s = 1e-6;
  double step_at_s = 1e9, step_s = 0;
  double query_s = 0.05;
  double start_host_s = 123456.789, start_remote_s = 77.7;

  double Remote(double host_s) const {
    const double t = host_s - start_host_s;
    const double drifted = drift_ppm * 1e-6 * t + 0.5 * drift_change_ppm_per_min * 1e-6 / 60 * t * t;
    return start_remote_s + nominal_rate * (t + drifted) + (t >= step_at_s ? step_s : 0);
  }
  double Delay(double min_s, RandomStream& random) const {
    double delay_s = min_s + random.Uniform(0, jitter_s);
    if (random.Uniform() < tail_share) delay_s += -tail_s * std::log(1 - random.Uniform());
    return delay_s;
  }
  // Runs queries for so long; `look` is called after each with the host time.
  void Run(ClockSync& sync, double begin_s, double end_s, RandomStream& random,
           const std::function<void(double)>& look = nullptr) const {
    for (double t = begin_s; t < end_s; t += query_s) {
      const double send_s = start_host_s + t;
      const double received_s = send_s + Delay(there_s, random);
      const double answered_s = received_s + 0.0001;
      const double arrived_s = answered_s + Delay(back_s, random);
      const bool lost = random.Uniform() < lost_share;
      const double tick = tick_s * nominal_rate;
      if (!lost)
        sync.AddRoundTrip(send_s, std::floor(Remote(received_s) / tick) * tick,
                          std::floor(Remote(answered_s) / tick) * tick, arrived_s);
      if (look) look(arrived_s);
    }
  }
  // Of a mapped time, host seconds.
  double ErrorS(const ClockEstimate& estimate, double host_s) const {
    return (estimate.RemoteOf(host_s) - Remote(host_s)) / nominal_rate;
  }
};

TEST(ClockSync, KnowsNothingBeforeTheFirstMessage) {
  ClockSync sync;
  EXPECT_FALSE(sync.Estimate().valid);
  sync.AddRoundTrip(10, 5, 5, 9);  // answered before it was asked
  EXPECT_FALSE(sync.Estimate().valid);
}

TEST(ClockSync, FindsTheOffsetUnderFiveMillisecondsOfJitter) {
  TOUCHSTONE_SECOND_TIER("statistical: many runs of an hour of heartbeats");
  for (const double drift_ppm : {-200.0, -100.0, 0.0, 100.0, 200.0}) {
    if (kUnderSanitizers && drift_ppm != 100) continue;
    for (const double jitter_s : {0.0, 0.001, 0.005}) {
      double worst_s = 0;
      for (int seed = 0; seed < (kUnderSanitizers ? 1 : 6); ++seed) {
        RandomStream random(seed, RandomDomain::kTest, 1);
        Line line;
        line.drift_ppm = drift_ppm;
        line.jitter_s = jitter_s;
        line.lost_share = 0.1;
        ClockSync sync;
        line.Run(sync, 0, 60, random);
        line.Run(sync, 60, 90, random, [&](double host_s) {
          worst_s = std::max(worst_s, std::abs(line.ErrorS(sync.Estimate(), host_s - 0.5)));
        });
      }
      EXPECT_LT(worst_s, 50e-6) << drift_ppm << " ppm, jitter " << jitter_s << " s";
    }
  }
}

// The root mean square and the greatest of |error| / uncertainty over many lines, and of |error|, a minute
// after the start.
struct Quality {
  double within_two_sigma = 0;
  double worst_s = 0;
  double worst_sigmas = 0;
};
Quality Judge(const Line& line, double from_s, double to_s, int seeds) {
  Quality quality;
  int looks = 0;
  for (int seed = 0; seed < seeds; ++seed) {
    RandomStream random(seed, RandomDomain::kTest, 2);
    Line each = line;
    // The two ways share the shortest round trip as unevenly as the uncertainty allows for.
    const double shortest_s = line.there_s + line.back_s;
    const double share = std::clamp(0.5 + 0.1 * random.Normal(), 0.0, 1.0);
    each.there_s = share * shortest_s;
    each.back_s = (1 - share) * shortest_s;
    ClockSync sync(line.nominal_rate);
    each.Run(sync, 0, from_s, random);
    int number = 0;
    each.Run(sync, from_s, to_s, random, [&](double host_s) {
      if (++number % 20 != 0) return;
      const ClockEstimate estimate = sync.Estimate();
      const double error_s = std::abs(each.ErrorS(estimate, host_s));
      const double sigmas = error_s * line.nominal_rate / estimate.offset_uncertainty_s;
      quality.within_two_sigma += sigmas <= 2 ? 1 : 0;
      quality.worst_sigmas = std::max(quality.worst_sigmas, sigmas);
      quality.worst_s = std::max(quality.worst_s, error_s);
      ++looks;
    });
  }
  quality.within_two_sigma /= looks;
  return quality;
}

TEST(ClockSync, TellsItsUncertaintyHonestly) {
  if (kUnderSanitizers) GTEST_SKIP() << "statistics; other builds look at them";
  Line uniform;
  Line quiet = uniform;
  quiet.jitter_s = 0.00005;
  Line tails = uniform;
  tails.jitter_s = 0.001;
  tails.tail_share = 0.3;
  tails.tail_s = 0.02;
  tails.lost_share = 0.2;
  for (const Line& line : {uniform, quiet, tails}) {
    for (const double from_s : {2.0, 60.0}) {
      const Quality quality = Judge(line, from_s, from_s + 5, 40);
      EXPECT_GT(quality.within_two_sigma, 0.88)
          << "jitter " << line.jitter_s << " s after " << from_s << " s";
      EXPECT_LT(quality.worst_sigmas, 6) << "jitter " << line.jitter_s << " s after " << from_s << " s";
    }
  }
}

TEST(ClockSync, FollowsAClockThatWarms) {
  TOUCHSTONE_SECOND_TIER("long: hours of heartbeats");
  if (kUnderSanitizers) GTEST_SKIP() << "statistics; other builds look at them";
  for (const double change : {-1.0, 1.0}) {
    Line line;
    line.drift_change_ppm_per_min = change;
    double worst_s = 0;
    for (int seed = 0; seed < 3; ++seed) {
      RandomStream random(seed, RandomDomain::kTest, 3);
      ClockSync sync;
      line.Run(sync, 0, 300, random);
      line.Run(sync, 300, 360, random, [&](double host_s) {
        worst_s = std::max(worst_s, std::abs(line.ErrorS(sync.Estimate(), host_s - 0.5)));
      });
    }
    EXPECT_LT(worst_s, 60e-6) << change << " ppm a minute";
  }
}

TEST(ClockSync, WorksAtAThousandTimesTheSpeed) {
  Line line;
  line.nominal_rate = 1000;
  line.drift_ppm = 100;
  line.jitter_s = 0.0002;
  RandomStream random(1, RandomDomain::kTest, 4);
  ClockSync sync(1000);
  line.Run(sync, 0, 30, random);
  const ClockEstimate estimate = sync.Estimate();
  EXPECT_NEAR(estimate.rate, 1000.1, 1e-3);
  EXPECT_LT(std::abs(line.ErrorS(estimate, estimate.host_at_s)), 10e-6);
  const double host_s = line.start_host_s + 29.5;
  EXPECT_NEAR(estimate.HostOf(line.Remote(host_s)), host_s, 20e-6);
}

TEST(ClockSync, StartsAnewAfterAStep) {
  for (const double step_s : {-1000.0, -0.05, 0.05, 1000.0}) {
    Line line;
    line.step_at_s = 60;
    line.step_s = step_s;
    RandomStream random(1, RandomDomain::kTest, 5);
    ClockSync sync;
    line.Run(sync, 0, 60, random);
    EXPECT_LT(std::abs(line.ErrorS(sync.Estimate(), line.start_host_s + 59)), 50e-6);
    line.Run(sync, 60.01, 70, random);
    EXPECT_LT(std::abs(line.ErrorS(sync.Estimate(), line.start_host_s + 70)), 200e-6) << step_s << " s";
  }
}

TEST(ClockSync, IgnoresSingleContradictions) {
  Line line;
  RandomStream random(1, RandomDomain::kTest, 6);
  ClockSync sync;
  line.Run(sync, 0, 30, random);
  const ClockEstimate before = sync.Estimate();
  for (int i = 0; i < 3; ++i) {
    const double host_s = line.start_host_s + 30;
    sync.AddRoundTrip(host_s, line.Remote(host_s) + 5 * (i - 1) + 0.5,
                      line.Remote(host_s) + 5 * (i - 1) + 0.5, host_s + 0.001);
  }
  const ClockEstimate after = sync.Estimate();
  EXPECT_EQ(after.remote_at_s, before.remote_at_s);
  EXPECT_EQ(after.round_trips, before.round_trips);
}

TEST(ClockSync, TakesTheShortestDelayOfOneWayAsTold) {
  Line line;
  line.drift_ppm = 50;
  RandomStream random(1, RandomDomain::kTest, 7);
  ClockSync sync;
  const double shortest_s = 0.0005;
  for (double t = 0; t < 20; t += 0.008) {
    const double sent_s = line.start_host_s + t;
    sync.AddOneWay(line.Remote(sent_s), sent_s + shortest_s + random.Uniform(0, 0.002), shortest_s);
  }
  const ClockEstimate estimate = sync.Estimate();
  EXPECT_LT(std::abs(line.ErrorS(estimate, line.start_host_s + 19.5)), 30e-6);
  EXPECT_NEAR(estimate.rate, 1 + 50e-6, 5e-6);
  EXPECT_GE(estimate.offset_uncertainty_s, shortest_s);
}

TEST(ClockSync, ForgetsAllAtReset) {
  Line line;
  RandomStream random(1, RandomDomain::kTest, 8);
  ClockSync sync;
  line.Run(sync, 0, 5, random);
  ASSERT_TRUE(sync.Estimate().valid);
  sync.Reset();
  EXPECT_FALSE(sync.Estimate().valid);
  EXPECT_EQ(sync.Estimate().round_trips, 0u);
}

}  // namespace
}  // namespace touchstone::gateway::timing
