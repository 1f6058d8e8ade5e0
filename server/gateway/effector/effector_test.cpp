// What a touch's contacts, clock and refusals come to while the line is good; effector_line_test.cpp has the
// bad ones.
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "server/gateway/effector/effector_fixture.h"

namespace touchstone::gateway::effector {
namespace {

using testing::HasSubstr;

class EffectorTest : public EffectorFixture {};

TEST_F(EffectorTest, TellsTheContactOfEachFinger) {
  for (int fingers = 1; fingers <= 8; ++fingers) {
    Start();
    Open(Options(fingers));
    EXPECT_EQ(effector_->State().firmware, "fake 1.2.3");
    ASSERT_TRUE(effector_->StartCapture(17).ok());
    std::vector<uint64_t> truth;
    for (int i = 0; i < fingers; ++i) truth.push_back(device_->Press(i));
    ASSERT_TRUE(WaitForContacts(fingers));
    for (int i = 0; i < fingers; ++i) device_->Release(i);
    ASSERT_TRUE(effector_->EndCapture().ok());
    const absl::StatusOr<EffectorTouch> touch = effector_->Touch();
    ASSERT_TRUE(touch.ok()) << touch.status();
    EXPECT_EQ(touch->touch, 17u);
    EXPECT_EQ(touch->pressed_mask, 0u);
    EXPECT_EQ(touch->boot_id, 1001u);
    EXPECT_LE(touch->armed_ticks, truth[0]);
    for (int i = 0; i < fingers; ++i) EXPECT_EQ(touch->contact_ticks[i], truth[i]);
    effector_.reset();
  }
}

TEST_F(EffectorTest, TellsWhichFingersDidNotLetGo) {
  Open(StartQuick());
  ASSERT_TRUE(effector_->StartCapture(1).ok());
  for (int i = 0; i < 3; ++i) device_->Press(i);
  ASSERT_TRUE(WaitForContacts(3));
  device_->Release(1);
  ASSERT_TRUE(effector_->EndCapture().ok());
  EXPECT_EQ(effector_->Touch()->pressed_mask, 0b101u);
  EXPECT_EQ(FingersText(0b101), "fingers 1, 3");
  EXPECT_EQ(FingersText(0b10), "finger 2");
}

TEST_F(EffectorTest, TellsWhenAFingerLetGoAlsoIfTheFirstEventOfItWasLost) {
  Open(StartQuick());
  ASSERT_TRUE(effector_->StartCapture(1).ok());
  device_->Press(0), device_->Press(1);
  ASSERT_TRUE(WaitForContacts(2));
  FakeDevice::Line dead;
  dead.drop = 1;
  device_->SetLine(dead);
  const uint64_t truth = device_->Release(1);
  device_->SetLine(FakeDevice::Line());
  ASSERT_TRUE(effector_->EndCapture().ok());
  const absl::StatusOr<EffectorTouch> touch = effector_->Touch();
  ASSERT_TRUE(touch.ok()) << touch.status();
  EXPECT_EQ(touch->release_ticks[1], truth);
  EXPECT_FALSE(touch->release_ticks[0].has_value()) << "pressed still";
  EXPECT_FALSE(touch->release_ticks[2].has_value()) << "never pressed";
}

TEST_F(EffectorTest, TellsTimesBeyondTheWrapOfTheCounter) {
  FakeDevice::Options device;
  device.first_tick = 0xffffffff - 300000;  // 0.3 s before
  Start(device);
  Open(Options());
  ASSERT_TRUE(effector_->StartCapture(1).ok());
  const uint64_t before = device_->Press(0);
  ASSERT_TRUE(WaitFor([&] { return device_->NowTicks() > (uint64_t{1} << 32) + 10000; }));
  const uint64_t after = device_->Press(1);
  ASSERT_GT(after, uint64_t{1} << 32);
  ASSERT_TRUE(WaitForContacts(2));
  EXPECT_EQ(effector_->Touch()->contact_ticks[0], before);
  EXPECT_EQ(effector_->Touch()->contact_ticks[1], after);
}

TEST_F(EffectorTest, TellsTheRecordToTheNextGateway) {
  Start();
  Open(Options());
  ASSERT_TRUE(effector_->StartCapture(9).ok());
  const uint64_t first = device_->Press(1);
  ASSERT_TRUE(WaitForContacts(1));
  effector_.reset();
  const uint64_t second = device_->Press(2);  // between two gateways

  Open(Options());
  ASSERT_TRUE(WaitForConnection());
  const absl::StatusOr<EffectorTouch> touch = effector_->Recall(9);
  ASSERT_TRUE(touch.ok()) << touch.status();
  EXPECT_EQ(touch->touch, 9u);
  EXPECT_EQ(touch->boot_id, 1001u);
  EXPECT_EQ(touch->contact_ticks[0], std::nullopt);
  EXPECT_EQ(touch->contact_ticks[1], first);
  EXPECT_EQ(touch->contact_ticks[2], second);
  EXPECT_TRUE(absl::IsNotFound(effector_->Recall(8).status()));
}

TEST_F(EffectorTest, NamesTheFingersThatArePressedTooEarly) {
  Start();
  Open(Options());
  device_->Press(1);
  device_->Press(2);
  const absl::Status status = effector_->StartCapture(3);
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("fingers 2, 3 are pressed"));
  device_->Release(1);
  device_->Release(2);
  EXPECT_TRUE(effector_->StartCapture(4).ok());
}

TEST_F(EffectorTest, RefusesAFirmwareOfAnotherVersion) {
  FakeDevice::Options device;
  device.answers_with_version = 2;
  Start(device);
  const absl::Status status = Effector::Open(Options(), &changes_).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("version 2 of the protocol, this gateway version 1"));
}

TEST_F(EffectorTest, RefusesOptionsThatMakeNoSense) {
  Start();
  const auto error = [&](const EffectorOptions& options) {
    return std::string(Effector::Open(options, &changes_).status().message());
  };
  EXPECT_THAT(error(Options(0)), HasSubstr("0 fingers; right is 1 to 8"));
  EXPECT_THAT(error(Options(9)), HasSubstr("9 fingers; right is 1 to 8"));
  EXPECT_THAT(std::string(ParseSensor("optcal", "finger 2").status().message()),
              HasSubstr("finger 2: unknown sensor 'optcal', did you mean 'optical'?"));
  EffectorOptions options = Options();
  options.baud = 12345;
  EXPECT_THAT(error(options), HasSubstr("no rate of 12345 baud"));
  options = Options();
  options.port += "s";
  EXPECT_THAT(error(options), HasSubstr("No such file"));
  options = Options();
  options.time_scale = 0;
  EXPECT_THAT(error(options), HasSubstr("time_scale is 0"));
}

TEST_F(EffectorTest, RefusesAPortThatAnotherProcessHas) {
  Start();
  Open(Options());
  EXPECT_THAT(std::string(Effector::Open(Options(), &changes_).status().message()),
              HasSubstr("used by another process"));
}

TEST_F(EffectorTest, TellsTheDevicesClockInHostTime) {
  for (const double time_scale : {1.0, 50.0}) {
    FakeDevice::Options device;
    device.ticks_per_s = 1e6 * time_scale * (1 + 100e-6);
    Start(device);
    EffectorOptions options = Options();
    options.time_scale = time_scale;
    options.clock_query_s = 0.001;
    Open(options);
    ASSERT_TRUE(WaitFor([&] { return effector_->Clock().round_trips >= 100; }));
    ASSERT_TRUE(effector_->StartCapture(1).ok());
    const double before_s = timing::HostNowS();
    const uint64_t ticks = device_->Press(0);
    const double after_s = timing::HostNowS();
    ASSERT_TRUE(WaitForContacts(1));
    const timing::ClockEstimate clock = effector_->Clock();
    const double contact_s = clock.HostOf(ticks * 1e-6);
    // However slow the machine, the truth is within the shortest round trip.
    const double unsure_s = clock.shortest_round_trip_s + 1e-4;
    EXPECT_GT(contact_s, before_s - unsure_s);
    EXPECT_LT(contact_s, after_s + unsure_s);
    EXPECT_LT(clock.shortest_round_trip_s, 0.1);
    effector_.reset();
  }
}

TEST_F(EffectorTest, ShowsWhichFingersArePressed) {
  Start();
  Open(Options());
  device_->Press(2);
  EXPECT_TRUE(WaitFor([&] { return effector_->State().pressed == std::vector<bool>{false, false, true}; }));
  device_->Release(2);
  EXPECT_TRUE(WaitFor([&] { return effector_->State().pressed == std::vector<bool>{false, false, false}; }));
}

}  // namespace
}  // namespace touchstone::gateway::effector
