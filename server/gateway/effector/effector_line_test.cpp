// Noise, silence, resets and lies: a touch loses no contact and gets none that was not made.
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "server/gateway/effector/effector_fixture.h"

namespace touchstone::gateway::effector {
namespace {

using testing::HasSubstr;

class EffectorLineTest : public EffectorFixture {};

TEST_F(EffectorLineTest, LosesAndChangesNoContactOnABadLine) {
  EffectorOptions options = StartQuick();
  options.reply_timeout_s = 0.02;
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
    for (int i = 0; i < 3; ++i) device_->Release(i);
    const absl::Status disarmed = effector_->EndCapture();
    const absl::StatusOr<EffectorTouch> touch = effector_->Touch();
    if (!disarmed.ok() || !touch.ok()) continue;
    for (int i = 0; i < 3; ++i) ASSERT_EQ(touch->contact_ticks[i], truth[i]) << "touch " << id;
    ++right;
  }
  EXPECT_GE(right, 20);
  EXPECT_GT(effector_->State().bad_frames, 0u);
}

TEST_F(EffectorLineTest, GoesOnWithATouchWhenTheLineComesBack) {
  Start();
  Open(Options());
  const int hellos = device_->hellos();  // one, or more where an answer took long
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
  EXPECT_EQ(device_->hellos(), hellos) << "Hello would have disarmed it";
}

TEST_F(EffectorLineTest, SaysThatATouchIsLostWithTheDevicesMemory) {
  for (const bool unplugged : {true, false}) {
    Open(StartQuick());
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

TEST_F(EffectorLineTest, SaysThatATouchIsLostIfTheDeviceWasDisarmedMeanwhile) {
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

TEST_F(EffectorLineTest, WaitsForADeviceThatDoesNotAnswer) {
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

TEST_F(EffectorLineTest, NoticesSilence) {
  Start();
  EffectorOptions options = Options();
  options.silence_s = 0.5;
  Open(options);
  ASSERT_TRUE(StartCapturePatiently(1).ok());
  device_->Mute(true);
  ASSERT_TRUE(WaitFor([&] { return absl::IsUnavailable(effector_->Touch().status()); }));
  EXPECT_FALSE(effector_->State().connected);
  EXPECT_THAT(effector_->State().why, HasSubstr("nothing was heard"));
  device_->Mute(false);
  const uint64_t truth = device_->Press(0);
  EXPECT_TRUE(WaitFor([&] {
    const absl::StatusOr<EffectorTouch> touch = effector_->Touch();
    return touch.ok() && touch->contact_ticks[0] == truth;
  }));
}

// A touch that is final, but whose capture was not ended: the device that begins anew is not taken for one that
// should be armed, again and again.
TEST_F(EffectorLineTest, StaysConnectedAfterAResetBetweenTheLastContactAndTheEndOfTheCapture) {
  Open(StartQuick());
  ASSERT_TRUE(effector_->StartCapture(7).ok());
  for (int i = 0; i < 3; ++i) device_->Press(i);
  ASSERT_TRUE(WaitForContacts(3));
  ASSERT_TRUE(effector_->Recall(7).ok());  // comes after the record was read twice
  device_->Reset(2002);
  ASSERT_TRUE(WaitFor([&] { return effector_->State().connected && effector_->State().boot_id == 2002; }));
  const int hellos = device_->hellos();
  // Many statuses, of which three would have ended the session, and a request behind them.
  const int statuses = device_->statuses();
  ASSERT_TRUE(WaitFor([&] { return device_->statuses() > statuses + 5; }));
  const absl::Status forgotten = effector_->Recall(7).status();
  EXPECT_TRUE(absl::IsNotFound(forgotten)) << forgotten;
  EXPECT_EQ(device_->hellos(), hellos);
  EXPECT_EQ(effector_->Touch()->Contacts(), 3);
}

TEST_F(EffectorLineTest, BelievesNoImpossibleEvent) {
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

TEST_F(EffectorLineTest, CorrectsAWrongContactWhenAllFingersHaveReported) {
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

TEST_F(EffectorLineTest, HearsThroughGarbage) {
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

TEST_F(EffectorLineTest, CountsRepeatedEventsOnce) {
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

}  // namespace
}  // namespace touchstone::gateway::effector
