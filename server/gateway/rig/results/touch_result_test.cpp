#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/gateway/rig/results/touch_result.h"
#include "server/gateway/rig/results/touch_series.h"

namespace touchstone::gateway {
namespace {

constexpr double kSpeed = 0.02, kAcceleration = 1.2;
constexpr uint32_t kTickHz = 1'000'000;

// Distance that an arm has come t seconds after it began, at rest first.
double Distance(double t) {
  if (t <= 0) return 0;
  const double ramp_s = kSpeed / kAcceleration;
  return t < ramp_s ? 0.5 * kAcceleration * t * t : kSpeed * (t - 0.5 * ramp_s);
}

struct Scaling {
  double slider = 1, limiter = 1;
};

// An approach along -z that began at controller time 100.0013 s, told 500 times a second by a controller
// whose clock is 37 s ahead of the host's and 50 ppm fast, and contacts told by a device whose clock is
// 120 ppm slow.
struct Made {
  TouchRecording record;
  double began_controller_s = 100.0013;

  explicit Made(std::vector<std::optional<double>> contacts_s, Scaling scaling = Scaling()) {
    record.motion.program_id = 7;
    record.motion.speed_m_s = kSpeed;
    record.motion.transit = {Eigen::Isometry3d(Eigen::Translation3d(0.3, 0, 0.3))};
    record.motion.end = Eigen::Isometry3d(Eigen::Translation3d(0.3, 0, 0.2));
    record.acceleration_m_s2 = kAcceleration;
    record.tick_hz = kTickHz;
    record.unix_minus_host_s = 1e9;
    record.controller_clock = {true, 50, 87, 1 + 50e-6, 2e-5, 1e-7, 100, 1e-3};
    record.effector_clock = {true, 50, 1234, 1 - 120e-6, 1e-5, 1e-7, 100, 1e-3};
    for (int k = -50; k < 2000; ++k) {
      arm::ArmState state;
      state.controller_time_s = 100 + 0.002 * k;
      const double t = (state.controller_time_s - began_controller_s) / record.controller_clock.rate;
      state.program_id = 7;
      state.phase = t < 0 ? arm::MotionPhase::kReady : arm::MotionPhase::kApproach;
      state.base_from_tip.translation() = Eigen::Vector3d(0.3, 0, 0.3 - Distance(t));
      state.tip_velocity_m_s = Eigen::Vector3d(0, 0, -(Distance(t + 5e-4) - Distance(t - 5e-4)) / 1e-3);
      state.speed_scaling = scaling.limiter;
      state.target_speed_fraction = scaling.slider;
      record.states.push_back(state);
    }
    for (const auto& t : contacts_s) {
      if (!t.has_value()) {
        record.contacts.contact_ticks.push_back(std::nullopt);
        continue;
      }
      const double host_s = record.controller_clock.HostOf(began_controller_s) + *t;
      record.contacts.contact_ticks.push_back(
          static_cast<uint64_t>(std::llround(record.effector_clock.RemoteOf(host_s) * kTickHz)));
    }
  }
};

TEST(TouchResult, ContactTimesCountFromWhenTheApproachBegan) {
  const auto result = ResultOf(Made({{1.2}, {1.0}, {2.5}}).record);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_NEAR(result->fingers[0].contact_time_s, 1.2, 2e-6);
  EXPECT_NEAR(result->fingers[1].contact_time_s, 1.0, 2e-6);
  EXPECT_NEAR(result->fingers[2].contact_time_s, 2.5, 2e-6);
  // Host time 50 is controller time 87.
  EXPECT_NEAR(result->start_unix_s, 1e9 + 50 + 13.0013, 1e-3);
}

TEST(TouchResult, DifferencesAreInHostTimeWhateverTheEffectorsClockDoes) {
  const auto result = ResultOf(Made({{0.5}, {2.5}, {1.0}}).record);
  ASSERT_TRUE(result.ok()) << result.status();
  // Uncorrected, 120 ppm of 2 s would be 240 us.
  EXPECT_NEAR(result->fingers[1].contact_time_s - result->fingers[0].contact_time_s, 2.0, 2e-6);
  EXPECT_NEAR(result->effector_drift, -120e-6, 1e-9);
}

TEST(TouchResult, TooFewStatesOfTheApproachAreRefused) {
  Made made({{1.2}, {1.0}, {2.5}});
  std::vector<arm::ArmState> few;
  for (const arm::ArmState& state : made.record.states)
    if (std::abs(state.controller_time_s - 101.0) < 1e-6 || state.controller_time_s < 100)
      few.push_back(state);
  made.record.states = few;
  const auto result = ResultOf(made.record);
  EXPECT_EQ(result.status().code(), absl::StatusCode::kUnavailable) << result.status();
  EXPECT_THAT(std::string(result.status().message()), testing::HasSubstr("only 1 states"));
}

TEST(TouchResult, ContactsFartherApartThanTheTouchTookAreNotBelieved) {
  Made made({{1.2}, {1.0}, {1.1 + 268.4}});
  made.record.motion.duration_s = 8;
  const auto result = ResultOf(made.record);
  EXPECT_EQ(result.status().code(), absl::StatusCode::kDataLoss) << result.status();
}

TEST(TouchResult, AnErrorOfTheClocksNeverPutsAContactBeforeItsApproach) {
  Made made({{0.5}, {2.5}, {1.0}});
  made.record.controller_clock.remote_at_s -= 3;
  const auto result = ResultOf(made.record);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->fingers[0].contact_time_s, 0);
  EXPECT_NEAR(result->fingers[1].contact_time_s, 2.0, 2e-6);
  EXPECT_GT(result->synchronisation_uncertainty_s, 2.4) << "the times were moved by 2.5 s";
}

TEST(TouchResult, ThePoseAtContactIsInterpolatedAtItsMoment) {
  const auto result = ResultOf(Made({{1.2005}, {1.0}, {1.1}}).record);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_NEAR(result->fingers[0].base_from_tip[2], 0.3 - Distance(1.2005), 1e-7);
  EXPECT_NEAR(result->speed_m_s, kSpeed, 1e-5);
}

TEST(TouchResult, AFingerThatReportedNothingHasNeitherTimeNorPose) {
  const auto result = ResultOf(Made({{1.2}, std::nullopt, {1.3}}).record);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_TRUE(std::isnan(result->fingers[1].contact_time_s));
  EXPECT_TRUE(std::isnan(result->fingers[1].base_from_tip[0]));
  EXPECT_NEAR(result->fingers[2].contact_time_s, 1.3, 2e-6);
}

// Of contacts after 1.2, 1.25 and 1.3 s of an approach that turns back after 4 s; the second finger let go at_s.
TouchRecording LetGo(double at_s) {
  Made made({{1.2}, {1.25}, {1.3}});
  made.record.contacts.release_ticks = Made({std::nullopt, {at_s}, {4.02}}).record.contacts.contact_ticks;
  return made.record;
}

TEST(TouchResult, AFingerThatLetGoBeforeTheToolTurnedBackIsNamed) {
  EXPECT_TRUE(CheckHeld(LetGo(4)).ok()) << CheckHeld(LetGo(4));
  const absl::Status refused = CheckHeld(LetGo(1.5));
  EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(
      std::string(refused.message()),
      testing::HasSubstr("finger 2 let go 250 ms after it had reported a contact, while the tool still "
                         "approached"));
}

TEST(TouchResult, ThatAFingerLetGoTooEarlyIsClaimedOnlyIfItIsCertain) {
  TouchRecording record = LetGo(3.9);
  EXPECT_FALSE(CheckHeld(record).ok());
  record.effector_clock.offset_uncertainty_s = 0.05;
  EXPECT_TRUE(CheckHeld(record).ok());
  // Before the last contact it is certain whatever the clocks are.
  record = LetGo(1.29);
  record.effector_clock.valid = record.controller_clock.valid = false;
  EXPECT_FALSE(CheckHeld(record).ok());
  record.contacts.contact_ticks[1].reset();
  EXPECT_TRUE(CheckHeld(record).ok()) << "it had no contact";
}

TEST(TouchResult, ASpeedSliderOrALimiterBelowFullIsRefusedWithBothNumbers) {
  for (const auto& [slider, limiter] : {std::pair(0.5, 1.0), std::pair(1.0, 0.5), std::pair(0.9, 0.8)}) {
    const auto result = ResultOf(Made({{1.2}, {1.0}, {1.3}}, Scaling{slider, limiter}).record);
    ASSERT_EQ(result.status().code(), absl::StatusCode::kFailedPrecondition) << slider << " " << limiter;
    EXPECT_THAT(
        std::string(result.status().message()),
        testing::AllOf(testing::HasSubstr("slider stood at " + std::to_string(int(100 * slider)) + " %"),
                       testing::HasSubstr("limiter left " + std::to_string(int(100 * limiter)) + " %")));
  }
}

TEST(TouchResult, ASlowArmIsRefusedByItsPosesWhateverTheControllerSays) {
  Made made({{1.2}, {1.0}, {2.5}});
  for (arm::ArmState& state : made.record.states)
    state.base_from_tip.translation().z() = 0.3 - (0.3 - state.base_from_tip.translation().z()) * 0.5;
  const auto result = ResultOf(made.record);
  ASSERT_EQ(result.status().code(), absl::StatusCode::kFailedPrecondition) << result.status();
  EXPECT_THAT(std::string(result.status().message()),
              testing::AllOf(testing::HasSubstr("10 mm/s"), testing::HasSubstr("20 mm/s")));
}

TEST(TouchResult, ARecoveredTouchCountsFromItsFirstContact) {
  Made made({{1.2}, {1.0}, {2.5}});
  made.record.states.clear();
  EXPECT_EQ(ResultOf(made.record).status().code(), absl::StatusCode::kUnavailable);
  made.record.recovered = true;
  const auto result = ResultOf(made.record);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->fingers[1].contact_time_s, 0);
  EXPECT_NEAR(result->fingers[2].contact_time_s, 1.5, 2e-6);
  EXPECT_TRUE(std::isnan(result->fingers[0].base_from_tip[0]));
  EXPECT_TRUE(std::isnan(result->synchronisation_uncertainty_s));
}

TEST(TouchResult, UncertaintiesGrowWithTheClocksTheyComeFrom) {
  Made made({{1.2}, {1.0}, {2.5}});
  const auto good = ResultOf(made.record);
  made.record.effector_clock.offset_uncertainty_s *= 10;
  made.record.effector_clock.rate_uncertainty *= 1000;
  const auto bad = ResultOf(made.record);
  ASSERT_TRUE(good.ok() && bad.ok());
  EXPECT_GT(bad->synchronisation_uncertainty_s, 3 * good->synchronisation_uncertainty_s);
  EXPECT_GT(bad->time_uncertainty_s, 10 * good->time_uncertainty_s);
}

TEST(TouchSeries, HasEveryStateOfTheApproachOnTheContactsTime) {
  Made made({{1.2}, {1.0}, {2.5}});
  for (arm::ArmState& state : made.record.states) {
    state.joints_rad = {0, 1, 2, 3, 4, state.controller_time_s};
    state.tip_force_n = Eigen::Vector3d(1, 2, state.controller_time_s);
  }
  const auto series = SeriesOf(made.record);
  ASSERT_TRUE(series.ok()) << series.status();
  ASSERT_EQ(series->time_s_size(), 1999);
  ASSERT_EQ(series->joints_rad_size(), 6 * 1999);
  ASSERT_EQ(series->base_from_tip_size(), 6 * 1999);
  ASSERT_EQ(series->tip_force_n_size(), 3 * 1999);
  for (const int k : {0, 1000, 1998}) {
    const double t = series->time_s(k), controller_s = series->tip_force_n(3 * k + 2);
    EXPECT_NEAR(t, (controller_s - made.began_controller_s) / (1 + 50e-6), 3e-6) << k;
    EXPECT_EQ(series->joints_rad(6 * k + 5), controller_s) << k;
    EXPECT_NEAR(series->base_from_tip(6 * k + 2), 0.3 - Distance(t), 1e-7) << k;
  }
}

TEST(PoseAt, NothingIsMadeUpAcrossAGap) {
  const Made made({1.0, 1.1});
  EXPECT_TRUE(PoseAt(made.record.states, 101.0005, 0.1).has_value());
  EXPECT_FALSE(PoseAt(made.record.states, 99.0, 0.1).has_value());
  EXPECT_FALSE(PoseAt(made.record.states, 1e6, 0.1).has_value());
  std::vector<arm::ArmState> sparse = {made.record.states.front(), made.record.states.back()};
  EXPECT_FALSE(PoseAt(sparse, 101, 0.1).has_value());
}

}  // namespace
}  // namespace touchstone::gateway
