#include "server/gateway/clock_sync.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/base/random.h"

namespace touchstone {
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
  double Delay(double least_s, RandomStream& random) const {
    double delay_s = least_s + random.Uniform(0, jitter_s);
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
  for (const double drift_ppm : {-200.0, -100.0, 0.0, 100.0, 200.0}) {
    for (const double jitter_s : {0.0, 0.001, 0.005}) {
      double worst_s = 0;
      for (int seed = 0; seed < 6; ++seed) {
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

}  // namespace
}  // namespace touchstone
