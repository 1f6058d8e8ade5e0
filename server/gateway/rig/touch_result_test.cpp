#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/gateway/rig/touch_result.h"

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

// An approach along -z that began at controller time 100.0013 s, told 500 times a second by a controller
// whose clock is 37 s ahead of the host's and 50 ppm fast, and contacts told by a device whose clock is
// 120 ppm slow.
struct Made {
  TouchRecording record;
  double began_controller_s = 100.0013;

  explicit Made(std::vector<std::optional<double>> contacts_s, double scale = 1) {
    record.motion.program_id = 7;
    record.motion.speed_m_s = kSpeed;
    record.motion.transit = {Eigen::Isometry3d(Eigen::Translation3d(0.3, 0, 0.3))};
    record.motion.end = Eigen::Isometry3d(Eigen::Translation3d(0.3, 0, 0.2));
    record.acceleration_m_s2 = kAcceleration;
    record.tick_hz = kTickHz;
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
      state.speed_scaling = scale;
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
}

TEST(TouchResult, DifferencesAreInHostTimeWhateverTheEffectorsClockDoes) {
  const auto result = ResultOf(Made({{0.5}, {2.5}, {1.0}}).record);
  ASSERT_TRUE(result.ok()) << result.status();
  // Uncorrected, 120 ppm of 2 s would be 240 us.
  EXPECT_NEAR(result->fingers[1].contact_time_s - result->fingers[0].contact_time_s, 2.0, 2e-6);
  EXPECT_NEAR(result->effector_drift, -120e-6, 1e-9);
}

TEST(TouchResult, OneStateAtFullSpeedTellsWhenTheApproachBegan) {
  Made made({{1.2}, {1.0}, {2.5}});
  std::vector<arm::ArmState> few;
  for (const arm::ArmState& state : made.record.states)
    if (std::abs(state.controller_time_s - 101.0) < 1e-6 || state.controller_time_s < 100)
      few.push_back(state);
  made.record.states = few;
  const auto result = ResultOf(made.record);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_NEAR(result->fingers[0].contact_time_s, 1.2, 1e-4);
  EXPECT_EQ(result->speed_m_s, 0) << "one state tells no speed";
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

TEST(TouchResult, AScaledSpeedIsRefusedSinceItsTimesWouldMislead) {
  const auto result = ResultOf(Made({{1.2}, {1.0}, {1.3}}, 0.5).record);
  ASSERT_EQ(result.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(result.status().message()), testing::HasSubstr("50 %"));
}

TEST(TouchResult, WithoutTheArmsRecordTimesCountFromTheFirstContact) {
  Made made({{1.2}, {1.0}, {2.5}});
  made.record.states.clear();
  const auto result = ResultOf(made.record);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->fingers[1].contact_time_s, 0);
  EXPECT_NEAR(result->fingers[2].contact_time_s, 1.5, 2e-6);
  EXPECT_TRUE(std::isnan(result->fingers[0].base_from_tip[0]));
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
