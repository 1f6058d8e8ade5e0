#include "firmware/core/effector.h"

#include <gtest/gtest.h>

#include "firmware/core/test_device.h"

namespace touchstone::firmware {
namespace {

template <typename Message>
Refused RefusalOf(TestDevice* device, const Message& message) {
  Refused refused;
  EXPECT_TRUE(device->Ask(message, &refused));
  return refused;
}

TEST(Effector, TellsWhoItIs) {
  TestDevice device(16000000);
  HelloReply reply;
  ASSERT_TRUE(device.Ask(Hello{kProtocolVersion, 42}, &reply));
  EXPECT_EQ(reply.version, kProtocolVersion);
  EXPECT_EQ(reply.nonce, 42u);
  EXPECT_EQ(reply.boot_id, 0xB007u);
  EXPECT_EQ(reply.tick_hz, 16000000u);
  EXPECT_STREQ(reply.firmware, "test 1");
}

TEST(Effector, KeepsTheRecordAndTheEventsThroughHello) {
  TestDevice device;
  ASSERT_TRUE(device.DoConfigure(3, FingerConfig{}));
  ASSERT_TRUE(device.DoArm(8));
  device.Edge(1, true);
  const uint64_t contact = device.now();
  device.Drop();
  HelloReply hello;
  ASSERT_TRUE(device.Ask(Hello{}, &hello));

  // No longer armed: nothing more is recorded.
  device.Edge(2, true);
  Recalled record;
  ASSERT_TRUE(device.Ask(Recall{8}, &record));
  EXPECT_EQ(record.armed, 0);
  EXPECT_EQ(record.contact_mask, 2);
  EXPECT_EQ(record.ticks[1], contact);
  device.RunMs(60);
  Event event;
  ASSERT_TRUE(device.Take(&event));
  EXPECT_EQ(event.finger, 1);
  EXPECT_FALSE(device.Take(&event));
}

// An edge's time is captured by the hardware; how late it is handled must not cost what PROTOCOL.md promises.
TEST(Effector, ABounceCostsNothingHoweverLateItsEdgesAreHandled) {
  constexpr uint64_t kDebounceUs = 5000;
  FingerConfig config;
  config.sensor = Sensor::kMicroswitch;
  config.debounce_us = kDebounceUs;
  uint32_t random = 1;
  for (uint64_t late_us : {0, 900, 4000, 8000, 20000}) {
    for (int round = 0; round < 20; ++round) {
      TestDevice device;
      ASSERT_TRUE(device.DoConfigure(1, config));
      ASSERT_TRUE(device.DoArm(1));
      device.RunMs(30);
      const uint64_t contact = device.now() + 137;
      bool level = true;
      for (uint64_t at = contact; level || at < contact + 4000;) {
        device.RunTo(at + late_us);
        device.EdgeAt(0, level, at);
        random = random * 1664525 + 1013904223;
        at += 50 + random % 300;
        level = !level;
      }
      device.RunTo(contact + late_us + 3 * kDebounceUs);
      Event event;
      ASSERT_TRUE(device.Take(&event)) << late_us;
      EXPECT_EQ(event.kind, EventKind::kContact);
      EXPECT_EQ(event.ticks, contact) << "edges handled " << late_us << " us late, round " << round;
      EXPECT_FALSE(device.Take(&event)) << "one press";
    }
  }
}

TEST(Effector, RecordsNothingBeforeArmAndAfterDisarm) {
  TestDevice device;
  ASSERT_TRUE(device.DoConfigure(2, FingerConfig{}));
  device.Edge(0, true);
  device.Edge(0, false);
  ASSERT_TRUE(device.DoArm(1));
  Disarmed disarmed;
  ASSERT_TRUE(device.Ask(Disarm{}, &disarmed));
  ASSERT_TRUE(device.Ask(Disarm{}, &disarmed));  // again: the host repeats
  device.Edge(1, true);
  device.RunMs(100);
  EXPECT_EQ(device.Count<Event>(), 0);
}

TEST(Effector, LeavesOutAContactCapturedBeforeItWasArmed) {
  TestDevice device;
  ASSERT_TRUE(device.DoConfigure(2, FingerConfig{}));
  device.RunMs(5);
  ASSERT_TRUE(device.DoArm(1));
  device.EdgeAt(0, true, device.now() - 1);
  device.EdgeAt(1, true, device.now());
  Event event;
  ASSERT_TRUE(device.Take(&event));
  EXPECT_EQ(event.finger, 1);
  EXPECT_FALSE(device.Take(&event));
}

TEST(Effector, KeepsOnlyTheFirstContactAndTheFirstReleaseOfAFinger) {
  TestDevice device;
  ASSERT_TRUE(device.DoConfigure(1, FingerConfig{}));
  ASSERT_TRUE(device.DoArm(1));
  device.RunMs(1);
  const uint64_t contact = device.now();
  for (int i = 0; i < 5; ++i) {
    device.Edge(0, true);
    device.RunMs(1);
    device.Edge(0, false);
    device.RunMs(1);
  }
  Event first, second, third;
  ASSERT_TRUE(device.Take(&first));
  ASSERT_TRUE(device.Take(&second));
  EXPECT_FALSE(device.Take(&third));
  EXPECT_EQ(first.kind, EventKind::kContact);
  EXPECT_EQ(first.ticks, contact);
  EXPECT_EQ(second.kind, EventKind::kRelease);
  EXPECT_EQ(second.ticks, contact + 1000);
  EXPECT_EQ(second.number, first.number + 1);
}

TEST(Effector, TakesAPinsActiveLevelFromTheConfiguration) {
  TestDevice device;
  FingerConfig low;
  low.active_level = 0;
  device.Edge(0, true);  // idle
  ASSERT_TRUE(device.DoConfigure(2, low));
  ASSERT_TRUE(device.DoArm(1));
  device.Edge(0, false);
  Event event;
  ASSERT_TRUE(device.Take(&event));
  EXPECT_EQ(event.finger, 0);
  EXPECT_EQ(event.kind, EventKind::kContact);
}

TEST(Effector, RefusesToArmWhileASwitchIsStillSettling) {
  TestDevice device;
  FingerConfig config;
  config.sensor = Sensor::kMicroswitch;
  config.debounce_us = 5000;
  device.Edge(0, false);
  ASSERT_TRUE(device.DoConfigure(1, config));
  device.Edge(0, true);
  const Refused refused = RefusalOf(&device, Arm{1});
  EXPECT_EQ(refused.reason, RefusedReason::kPressed);
  EXPECT_EQ(refused.detail, 1u);
}

TEST(Effector, AnswersAnotherConfigurationInMidTouchWithARefusal) {
  TestDevice device;
  ASSERT_TRUE(device.DoConfigure(2, FingerConfig{}));
  ASSERT_TRUE(device.DoArm(6));
  ASSERT_TRUE(device.DoConfigure(2, FingerConfig{})) << "the same again is a repeated request";
  Configure other;
  other.fingers = 3;
  const Refused refused = RefusalOf(&device, other);
  EXPECT_EQ(refused.reason, RefusedReason::kBadValue);
  EXPECT_EQ(refused.detail, 6u);
  device.Edge(1, true);
  EXPECT_EQ(device.Count<Event>(), 1);
}

TEST(Effector, SendsEventsOfEarlierTouchesUntilTheyAreAcknowledged) {
  TestDevice device;
  ASSERT_TRUE(device.DoConfigure(8, FingerConfig{}));
  for (uint32_t touch = 1; touch <= 2; ++touch) {
    ASSERT_TRUE(device.DoArm(touch));
    for (int finger = 0; finger < 8; ++finger) device.Edge(finger, true);
    for (int finger = 0; finger < 8; ++finger) device.Edge(finger, false);
  }
  device.Drop();
  device.RunMs(90);
  uint32_t mask = 0;
  for (Event event; device.Take(&event);) {
    mask |= 1u << (event.number - 1);
    device.DoAcknowledge(event.number);
  }
  EXPECT_EQ(mask, 0xFFFFFFFFu) << "two touches of eight fingers make 32 events";
  device.RunMs(200);
  EXPECT_EQ(device.Count<Event>(), 0);
}

TEST(Effector, CountsEventsOfOldTouchesThatANeglectfulHostCostsIt) {
  TestDevice device;
  ASSERT_TRUE(device.DoConfigure(8, FingerConfig{}));
  for (uint32_t touch = 1; touch <= 3; ++touch) {
    ASSERT_TRUE(device.DoArm(touch));
    for (int finger = 0; finger < 8; ++finger) device.Edge(finger, true);
    for (int finger = 0; finger < 8; ++finger) device.Edge(finger, false);
  }
  device.Drop();
  Status status;
  ASSERT_TRUE(device.Ask(StatusRequest{}, &status));
  EXPECT_EQ(status.lost_events, 16u);
  // The newest are all there.
  device.RunMs(90);
  uint32_t newest = 0;
  for (Event event; device.Take(&event);) newest += event.touch == 3;
  EXPECT_GE(newest, 16u);
}

TEST(Effector, ForgetsTheEventsOfATouchThatIsBegunAnewUnderTheSameName) {
  TestDevice device;
  ASSERT_TRUE(device.DoConfigure(1, FingerConfig{}));
  ASSERT_TRUE(device.DoArm(1));
  device.Edge(0, true);
  device.Edge(0, false);
  Disarmed disarmed;
  ASSERT_TRUE(device.Ask(Disarm{}, &disarmed));
  device.RunMs(10);
  device.Drop();
  Armed armed;
  ASSERT_TRUE(device.DoArm(1, &armed));
  device.RunMs(200);
  EXPECT_EQ(device.Count<Event>(), 0);
  device.Edge(0, true);
  Event event;
  ASSERT_TRUE(device.Take(&event));
  EXPECT_GE(event.ticks, armed.ticks);
  EXPECT_EQ(event.number, 3u) << "numbers are never used again";
}

TEST(Effector, BeatsFourTimesASecond) {
  TestDevice device;
  device.RunMs(260);
  device.Drop();
  device.RunMs(5000);
  EXPECT_EQ(device.Count<Status>(), 20);
}

TEST(Effector, StampsAClockQueryTwice) {
  TestDevice device;
  ClockReply reply;
  ASSERT_TRUE(device.Ask(Clock{99}, &reply));
  EXPECT_EQ(reply.query, 99u);
  EXPECT_EQ(reply.receive_ticks, device.now());
  EXPECT_EQ(reply.send_ticks, device.now());
}

TEST(Effector, RefusesWhatIsMalformedButUndamaged) {
  TestDevice device;
  const auto ask = [&](std::initializer_list<uint8_t> fields) {
    uint8_t payload[kMaxPayload];
    size_t size = 0;
    for (uint8_t byte : fields) payload[size++] = byte;
    const uint32_t check = Crc32(payload, size);
    for (int i = 0; i < 4; ++i) payload[size++] = static_cast<uint8_t>(check >> (8 * i));
    device.SendPayload(payload, size);
    Refused refused;
    EXPECT_TRUE(device.Take(&refused));
    return refused;
  };
  EXPECT_EQ(ask({0x42}).reason, RefusedReason::kUnknownType);
  EXPECT_EQ(ask({0x42}).type, 0x42);
  EXPECT_EQ(ask({0x03, 1, 0, 0}).reason, RefusedReason::kBadLength);
  EXPECT_EQ(ask({0x03, 1, 0, 0}).detail, 5u);
  EXPECT_EQ(ask({0x03, 0, 0, 0, 0}).reason, RefusedReason::kBadValue);
  EXPECT_EQ(ask({0x02, 9}).reason, RefusedReason::kBadValue);
  EXPECT_EQ(ask({0x02, 1, 0}).reason, RefusedReason::kBadLength);
  EXPECT_EQ(RefusalOf(&device, Recall{4}).reason, RefusedReason::kUnknownTouch);
}

TEST(Effector, IsSilentAboutItsOwnMessagesAndAboutDamage) {
  TestDevice device;
  device.Send(Refused{});
  device.Send(Disarmed{});
  uint8_t payload[kMaxPayload];
  const size_t size = Encode(Clock{1}, payload);
  payload[2] ^= 1;  // a right CRC-16 about a wrong message
  device.SendPayload(payload, size);
  EXPECT_EQ(device.sent(), 0u);
  Status status;
  ASSERT_TRUE(device.Ask(StatusRequest{}, &status));
  EXPECT_EQ(status.bad_frames, 1u);
}

TEST(Effector, GivesAPressTheTimeOfItsOwnFirstEdgeNotOfASpikeLongBefore) {
  TestDevice device;
  FingerConfig config;
  config.sensor = Sensor::kMicroswitch;
  config.debounce_us = 5000;
  ASSERT_TRUE(device.DoConfigure(1, config));
  ASSERT_TRUE(device.DoArm(1));
  // Spikes every 3 ms, up to 6 ms before the press.
  for (int i = 0; i < 50; ++i) {
    device.Edge(0, true);
    device.RunTo(device.now() + 50);
    device.Edge(0, false);
    device.RunTo(device.now() + 2950);
  }
  device.RunMs(3);
  const uint64_t pressed = device.now();
  device.Edge(0, true);
  device.RunMs(20);
  Event event;
  ASSERT_TRUE(device.Take(&event));
  EXPECT_EQ(event.ticks, pressed);
}

TEST(Effector, HoldsThroughDropOuts) {
  TestDevice device;
  FingerConfig config;
  config.sensor = Sensor::kMicroswitch;
  config.debounce_us = 5000;
  ASSERT_TRUE(device.DoConfigure(1, config));
  ASSERT_TRUE(device.DoArm(1));
  device.RunMs(1);
  const uint64_t pressed = device.now();
  // Never closed for 5 ms in a row.
  for (int i = 0; i < 10; ++i) {
    device.Edge(0, true);
    device.RunMs(3);
    device.Edge(0, false);
    device.RunTo(device.now() + 100);
  }
  Event event;
  ASSERT_TRUE(device.Take(&event));
  EXPECT_EQ(event.ticks, pressed);
  EXPECT_FALSE(device.Take(&event)) << "a drop-out is no release";
}

}  // namespace
}  // namespace touchstone::firmware
