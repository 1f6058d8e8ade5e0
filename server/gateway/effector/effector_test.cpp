#include "server/gateway/effector/effector.h"

#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/gateway/effector/fake_device.h"

namespace touchstone::gateway::effector {
namespace {

using testing::HasSubstr;

constexpr double kLongS = 30;  // the machine may be busy

class EffectorTest : public testing::Test {
 protected:
  EffectorOptions Options(int fingers = 3) const {
    EffectorOptions options;
    options.port = device_->port();
    options.fingers = std::vector<EffectorFinger>(fingers);
    options.reply_timeout_s = 0.1;
    options.clock_query_s = 0.01;
    return options;
  }
  void Start(const FakeDevice::Options& device = FakeDevice::Options()) {
    device_ = std::make_unique<FakeDevice>(device);
  }
  void Open(const EffectorOptions& options) {
    absl::StatusOr<std::unique_ptr<Effector>> effector = Effector::Open(options, &changes_);
    ASSERT_TRUE(effector.ok()) << effector.status();
    effector_ = *std::move(effector);
  }
  bool WaitFor(const std::function<bool()>& done) {
    const double until_s = timing::HostNowS() + kLongS;
    while (timing::HostNowS() < until_s) {
      const uint64_t seen = changes_.count();
      if (done()) return true;
      changes_.WaitForChange(seen, 0.02);  // not every change that tests look at is notified
    }
    return false;
  }
  bool WaitForConnection(bool connected = true) {
    return WaitFor([&] { return effector_->State().connected == connected; });
  }
  bool WaitForContacts(int contacts) {
    return WaitFor([&] {
      const absl::StatusOr<EffectorTouch> touch = effector_->Touch();
      return touch.ok() && touch->Contacts() == contacts;
    });
  }
  absl::Status StartCapturePatiently(uint32_t touch) {
    absl::Status status;
    for (int i = 0; i < 50; ++i) {
      status = effector_->StartCapture(touch);
      if (!absl::IsUnavailable(status)) return status;
      WaitForConnection();
    }
    return status;
  }

  timing::ChangeNotifier changes_;
  std::unique_ptr<FakeDevice> device_;
  std::unique_ptr<Effector> effector_;
};

TEST_F(EffectorTest, TellsTheContactOfEachFinger) {
  for (int fingers = 1; fingers <= 8; ++fingers) {
    Start();
    Open(Options(fingers));
    EXPECT_EQ(effector_->State().firmware, "fake 1.2.3");
    ASSERT_TRUE(effector_->StartCapture(17).ok());
    std::vector<uint64_t> truth;
    for (int i = 0; i < fingers; ++i) truth.push_back(device_->Press(i));
    ASSERT_TRUE(WaitForContacts(fingers));
    ASSERT_TRUE(effector_->EndCapture().ok());
    const absl::StatusOr<EffectorTouch> touch = effector_->Touch();
    ASSERT_TRUE(touch.ok()) << touch.status();
    EXPECT_EQ(touch->touch, 17u);
    EXPECT_EQ(touch->boot_id, 1001u);
    EXPECT_LE(touch->armed_ticks, truth[0]);
    for (int i = 0; i < fingers; ++i) EXPECT_EQ(touch->contact_ticks[i], truth[i]);
    effector_.reset();
  }
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

TEST_F(EffectorTest, LosesAndChangesNoContactOnABadLine) {
  Start();
  EffectorOptions options = Options();
  options.reply_timeout_s = 0.05;
  Open(options);
  FakeDevice::Line line;
  line.drop = line.corrupt = line.duplicate = 0.004;
  device_->SetLine(line);
  int right = 0;
  for (uint32_t id = 1; id <= 30; ++id) {
    ASSERT_TRUE(StartCapturePatiently(id).ok());
    std::vector<uint64_t> truth;
    for (int i = 0; i < 3; ++i) truth.push_back(device_->Press(i));
    bool lost = false;
    ASSERT_TRUE(WaitFor([&] {
      const absl::StatusOr<EffectorTouch> touch = effector_->Touch();
      lost = !touch.ok() && !effector_->State().connected;
      return lost || (touch.ok() && touch->Contacts() == 3);
    }));
    const absl::Status disarmed = effector_->EndCapture();
    const absl::StatusOr<EffectorTouch> touch = effector_->Touch();
    for (int i = 0; i < 3; ++i) device_->Release(i);
    if (!disarmed.ok() || !touch.ok()) continue;
    for (int i = 0; i < 3; ++i) ASSERT_EQ(touch->contact_ticks[i], truth[i]) << "touch " << id;
    ++right;
  }
  EXPECT_GE(right, 20);
  EXPECT_GT(effector_->State().bad_frames, 0u);
}

TEST_F(EffectorTest, GoesOnWithATouchWhenTheLineComesBack) {
  Start();
  Open(Options());
  ASSERT_TRUE(effector_->StartCapture(5).ok());
  std::vector<uint64_t> truth = {device_->Press(0)};
  ASSERT_TRUE(WaitForContacts(1));
  device_->Unplug();
  truth.push_back(device_->Press(1));  // nobody hears it
  ASSERT_TRUE(WaitForConnection(false));
  EXPECT_TRUE(absl::IsUnavailable(effector_->Touch().status()));
  EXPECT_THAT(std::string(effector_->Touch().status().message()), HasSubstr("touch 5"));
  EXPECT_TRUE(absl::IsUnavailable(effector_->StartCapture(6)));
  device_->Plug();
  ASSERT_TRUE(WaitForContacts(2));
  truth.push_back(device_->Press(2));
  ASSERT_TRUE(WaitForContacts(3));
  ASSERT_TRUE(effector_->EndCapture().ok());
  for (int i = 0; i < 3; ++i) EXPECT_EQ(effector_->Touch()->contact_ticks[i], truth[i]);
  EXPECT_GE(effector_->State().reconnections, 1u);
  EXPECT_EQ(device_->hellos(), 1) << "Hello would have disarmed it";
}

TEST_F(EffectorTest, SaysThatATouchIsLostWithTheDevicesMemory) {
  for (const bool unplugged : {true, false}) {
    Start();
    Open(Options());
    ASSERT_TRUE(effector_->StartCapture(5).ok());
    device_->Press(0);
    ASSERT_TRUE(WaitForContacts(1));
    if (unplugged) device_->Unplug();
    device_->Reset(2002);
    if (unplugged) device_->Plug();
    ASSERT_TRUE(WaitFor([&] { return effector_->State().boot_id == 2002 && effector_->State().connected; }));
    const absl::Status lost = effector_->Touch().status();
    EXPECT_TRUE(absl::IsUnavailable(lost)) << lost;
    EXPECT_THAT(std::string(lost.message()), HasSubstr("reset during touch 5"));
    EXPECT_TRUE(absl::IsNotFound(effector_->Recall(5).status()));
    // The next one works.
    device_->Release(0);
    ASSERT_TRUE(StartCapturePatiently(6).ok());
    const uint64_t truth = device_->Press(2);
    ASSERT_TRUE(WaitForContacts(1));
    EXPECT_EQ(effector_->Touch()->contact_ticks[2], truth);
    EXPECT_EQ(effector_->Touch()->boot_id, 2002u);
    effector_.reset();
  }
}

TEST_F(EffectorTest, SaysThatATouchIsLostIfTheDeviceWasDisarmedMeanwhile) {
  Start();
  Open(Options());
  ASSERT_TRUE(effector_->StartCapture(5).ok());
  device_->Press(0);
  ASSERT_TRUE(WaitForContacts(1));
  device_->Unplug();
  device_->Tell(firmware::Hello{});  // by another program
  device_->Plug();
  ASSERT_TRUE(WaitFor([&] { return effector_->State().reconnections > 0 && effector_->State().connected; }));
  const absl::Status lost = effector_->Touch().status();
  EXPECT_TRUE(absl::IsUnavailable(lost)) << lost;
  EXPECT_THAT(std::string(lost.message()), HasSubstr("disarmed during touch 5"));
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

TEST_F(EffectorTest, WaitsForADeviceThatDoesNotAnswer) {
  Start();
  device_->Mute(true);
  EffectorOptions options = Options();
  options.reply_timeout_s = 0.02;
  Open(options);
  EXPECT_FALSE(effector_->State().connected);
  EXPECT_THAT(effector_->State().why, HasSubstr("no answer"));
  EXPECT_TRUE(absl::IsUnavailable(effector_->StartCapture(1)));
  device_->Mute(false);
  ASSERT_TRUE(WaitForConnection());
  EXPECT_TRUE(StartCapturePatiently(1).ok());
}

TEST_F(EffectorTest, NoticesSilence) {
  Start();
  EffectorOptions options = Options();
  options.silence_s = 0.6;
  Open(options);
  ASSERT_TRUE(effector_->StartCapture(1).ok());
  device_->Mute(true);
  ASSERT_TRUE(WaitForConnection(false));
  EXPECT_TRUE(absl::IsUnavailable(effector_->Touch().status()));
  device_->Mute(false);
  const uint64_t truth = device_->Press(0);
  ASSERT_TRUE(WaitForContacts(1));
  EXPECT_EQ(effector_->Touch()->contact_ticks[0], truth);
}

TEST_F(EffectorTest, BelievesNoImpossibleEvent) {
  Start();
  Open(Options());
  ASSERT_TRUE(effector_->StartCapture(7).ok());
  const uint64_t armed = effector_->Touch()->armed_ticks;
  const auto inject = [&](uint32_t number, uint32_t touch, uint8_t finger, uint64_t ticks) {
    device_->InjectMessage(firmware::Event{number, touch, finger, firmware::EventKind::kContact, ticks});
  };
  inject(901, 7, 5, armed + 100);                          // no such finger
  inject(902, 7, 0, armed - 1);                            // before it was armed
  inject(903, 7, 0, device_->NowTicks() + 100 * 1000000);  // in a hundred seconds
  inject(904, 6, 0, armed + 100);                          // of another touch, once
  inject(905, 4, 0, armed + 100);                          // and twice alike
  inject(905, 4, 0, armed + 100);
  inject(906, 7, 1, armed + 100);  // possible
  ASSERT_TRUE(WaitFor([&] { return device_->Acknowledged(906) > 0; }));
  const absl::StatusOr<EffectorTouch> touch = effector_->Touch();
  ASSERT_TRUE(touch.ok());
  EXPECT_EQ(touch->contact_ticks[0], std::nullopt);
  EXPECT_EQ(touch->contact_ticks[1], armed + 100);
  for (uint32_t number = 901; number <= 904; ++number) EXPECT_EQ(device_->Acknowledged(number), 0) << number;
  EXPECT_GE(device_->Acknowledged(905), 1);

  // The device's record puts right what was possible but wrong.
  ASSERT_TRUE(effector_->EndCapture().ok());
  EXPECT_EQ(effector_->Touch()->Contacts(), 0);
}

TEST_F(EffectorTest, CorrectsAWrongContactWhenAllFingersHaveReported) {
  Start();
  Open(Options());
  ASSERT_TRUE(effector_->StartCapture(7).ok());
  std::vector<uint64_t> truth = {device_->Press(0)};
  device_->InjectMessage(firmware::Event{900, 7, 1, firmware::EventKind::kContact, truth[0] + 3});
  ASSERT_TRUE(WaitForContacts(2));
  truth.push_back(device_->Press(1));
  truth.push_back(device_->Press(2));
  ASSERT_TRUE(WaitFor([&] { return effector_->Touch()->contact_ticks[1] == truth[1]; }));
  ASSERT_TRUE(effector_->EndCapture().ok());
  for (int i = 0; i < 3; ++i) EXPECT_EQ(effector_->Touch()->contact_ticks[i], truth[i]);
}

TEST_F(EffectorTest, HearsThroughGarbage) {
  Start();
  Open(Options());
  RandomStream random(3, RandomDomain::kTest);
  for (uint32_t id = 1; id <= 10; ++id) {
    ASSERT_TRUE(StartCapturePatiently(id).ok());
    std::vector<uint8_t> garbage;
    for (int i = 0; i < 300; ++i) garbage.push_back(static_cast<uint8_t>(random.Below(256)));
    device_->Inject(garbage);
    const uint64_t truth = device_->Press(1);
    device_->Inject(garbage);
    ASSERT_TRUE(WaitForContacts(1));
    EXPECT_EQ(effector_->Touch()->contact_ticks[1], truth);
    device_->Release(1);
    ASSERT_TRUE(effector_->EndCapture().ok());
  }
  EXPECT_GT(effector_->State().bad_frames, 10u);
}

TEST_F(EffectorTest, CountsRepeatedEventsOnce) {
  Start();
  Open(Options());
  ASSERT_TRUE(effector_->StartCapture(2).ok());
  const uint64_t truth = device_->Press(0);
  ASSERT_TRUE(WaitForContacts(1));
  for (int i = 0; i < 3; ++i)
    device_->InjectMessage(firmware::Event{1, 2, 0, firmware::EventKind::kContact, truth});
  ASSERT_TRUE(WaitFor([&] { return effector_->State().repeated_events >= 3; }));
  EXPECT_EQ(effector_->Touch()->Contacts(), 1);
  EXPECT_TRUE(WaitFor([&] { return device_->Acknowledged(1) >= 4; })) << "each copy is acknowledged";
}

TEST_F(EffectorTest, TellsTheDevicesClockInHostTime) {
  for (const double time_scale : {1.0, 50.0}) {
    FakeDevice::Options device;
    device.ticks_per_s = 1e6 * time_scale * (1 + 100e-6);
    Start(device);
    EffectorOptions options = Options();
    options.time_scale = time_scale;
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
