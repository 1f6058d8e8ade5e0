#include "firmware/core/portable_checks.h"

#include <cstring>
#include <initializer_list>

#include "firmware/core/frame.h"
#include "firmware/core/test_device.h"
#include "firmware/core/ticks.h"
#include "firmware/core/vectors.h"

namespace touchstone::firmware {
namespace {

#define TEXT_OF(x) #x
#define LINE_TEXT(x) TEXT_OF(x)
#define HOLDS(...) \
  if (!(__VA_ARGS__)) return __FILE__ ":" LINE_TEXT(__LINE__) ": " #__VA_ARGS__

FingerConfig Microswitch(uint32_t debounce_us) {
  FingerConfig config;
  config.sensor = Sensor::kMicroswitch;
  config.debounce_us = debounce_us;
  return config;
}

const char* CrcsHaveTheirPublishedValues(const char*) {
  const uint8_t* digits = reinterpret_cast<const uint8_t*>("123456789");
  HOLDS(Crc16(digits, 9) == 0x29B1);
  HOLDS(Crc32(digits, 9) == 0xCBF43926);
  return nullptr;
}

const char* EveryVectorAgreesBothWays(const char* vectors) {
  static Vector vector;
  int count = 0;
  for (; NextVector(&vectors, &vector); ++count) {
    const char* difference = CheckVector(vector);
    if (difference != nullptr) return difference;
  }
  HOLDS(count >= 17);  // one of every message at least
  return nullptr;
}

// Pushes the first `size` bytes, an end, and the undamaged frame: how many frames come out, and whether the
// last is the undamaged one.
bool OnlyTheUndamagedPasses(const uint8_t* damaged, size_t size, const Vector& vector) {
  FrameParser parser;
  int good = 0;
  for (size_t i = 0; i < size; ++i)
    good += parser.Push(damaged[i]) && IsIntact(parser.payload(), parser.size());
  good += parser.Push(0) && IsIntact(parser.payload(), parser.size());
  if (good != 0) return false;
  for (size_t i = 0; i < vector.frame_size; ++i) {
    if (parser.Push(vector.frame[i])) ++good;
  }
  return good == 1 && IsIntact(parser.payload(), parser.size());
}

const char* NoFlippedBitPasses(const char* vectors) {
  static Vector vector;
  uint8_t damaged[192];
  while (NextVector(&vectors, &vector)) {
    // The flipped delimiter glues the frame to the next: two bits of the end are tried by the truncations.
    for (size_t bit = 0; bit < (vector.frame_size - 1) * 8; ++bit) {
      std::memcpy(damaged, vector.frame, vector.frame_size);
      damaged[bit / 8] = static_cast<uint8_t>(damaged[bit / 8] ^ 1u << bit % 8);
      HOLDS(OnlyTheUndamagedPasses(damaged, vector.frame_size, vector));
    }
  }
  return nullptr;
}

const char* NoTruncationPasses(const char* vectors) {
  static Vector vector;
  while (NextVector(&vectors, &vector)) {
    for (size_t from = 0; from < vector.frame_size; ++from) {
      for (size_t size = 0; from + size < vector.frame_size; ++size) {
        if (from == 0 && size == vector.frame_size - 1)
          continue;  // only the delimiter is gone, and comes again
        HOLDS(OnlyTheUndamagedPasses(vector.frame + from, size, vector));
      }
    }
  }
  return nullptr;
}

const char* TicksRunOnAcrossEveryWrap(const char*) {
  for (unsigned bits : {24u, 32u}) {
    const uint64_t turn = uint64_t{1} << bits;
    TickExtender ticks(bits);
    uint64_t truth = turn - 5;
    for (int i = 0; i < 40; ++i, truth += turn / 2 - 1 - static_cast<uint64_t>(i)) {
      HOLDS(ticks.Extend(static_cast<uint32_t>(truth)) == truth);
      // Captured before, read after: right, and without effect on what follows.
      const uint64_t before = truth - turn / 3;
      HOLDS(truth < turn || ticks.Extend(static_cast<uint32_t>(before)) == before);
    }
  }
  return nullptr;
}

const char* ContactTimesAreRightAcrossTheWrap(const char*) {
  for (unsigned bits : {24u, 32u}) {
    const uint64_t turn = uint64_t{1} << bits;
    for (int64_t around : {-3, -1, 0, 1, 3}) {
      // 16 MHz; the counter wraps a moment before or after the edge, which is handled half
      // a millisecond late.
      TestDevice device(16000000, static_cast<uint8_t>(bits), turn - 16000 * 20);
      HOLDS(device.DoConfigure(3, FingerConfig{}));
      Armed armed;
      HOLDS(device.DoArm(9, &armed));
      HOLDS(armed.ticks == turn - 16000 * 20);
      const uint64_t edge = turn + static_cast<uint64_t>(around);
      device.RunTo(turn + 8000);
      device.EdgeAt(1, true, edge);
      Event event;
      HOLDS(device.Take(&event));
      HOLDS(event.touch == 9 && event.finger == 1 && event.kind == EventKind::kContact);
      HOLDS(event.ticks == edge);
    }
  }
  return nullptr;
}

const char* BounceHasTheTimeOfItsFirstEdge(const char*) {
  TestDevice device;
  HOLDS(device.DoConfigure(2, Microswitch(5000)));
  HOLDS(device.DoArm(1));
  device.RunMs(100);
  const uint64_t first = device.now() + 137;
  bool level = false;
  // 20 us closed, 300 us open, and so on for 4 ms; then it holds.
  for (uint64_t at = 0; at < 4000; at += level ? 20 : 300) {
    device.RunTo(first + at);
    device.Edge(0, level = !level);
  }
  if (!level) device.Edge(0, true);
  Event event;
  HOLDS(!device.Take(&event));
  device.RunMs(12);
  HOLDS(device.Take(&event));
  HOLDS(event.kind == EventKind::kContact && event.finger == 0 && event.ticks == first);
  return nullptr;
}

const char* ShortSpikesAreNoContact(const char*) {
  TestDevice device;
  HOLDS(device.DoConfigure(1, Microswitch(5000)));
  HOLDS(device.DoArm(1));
  // 4.9 ms once, then 1 ms in every 3 for half a second.
  device.Edge(0, true);
  device.RunTo(device.now() + 4900);
  device.Edge(0, false);
  device.RunMs(20);
  for (int i = 0; i < 160; ++i) {
    device.Edge(0, true);
    device.RunMs(1);
    device.Edge(0, false);
    device.RunMs(2);
  }
  Event event;
  HOLDS(!device.Take(&event));
  // What is long enough is a contact, at its own time.
  device.RunMs(20);
  const uint64_t pressed = device.now();
  device.Edge(0, true);
  device.RunMs(8);
  HOLDS(device.Take(&event) && event.ticks == pressed);
  return nullptr;
}

const char* ArmIsRefusedWhileAFingerIsPressed(const char*) {
  TestDevice device;
  Refused refused;
  Arm arm;
  arm.touch = 3;
  HOLDS(device.Ask(arm, &refused) && refused.reason == RefusedReason::kNotConfigured);
  HOLDS(device.DoConfigure(3, FingerConfig{}));
  device.Edge(0, true);
  device.Edge(2, true);
  HOLDS(device.Ask(arm, &refused));
  HOLDS(refused.type == 0x03 && refused.reason == RefusedReason::kPressed && refused.detail == 5);
  device.Edge(0, false);
  device.Edge(2, false);
  HOLDS(device.DoArm(3));
  return nullptr;
}

const char* RepeatedArmForgetsNothing(const char*) {
  TestDevice device;
  HOLDS(device.DoConfigure(2, FingerConfig{}));
  Armed first, second;
  HOLDS(device.DoArm(5, &first));
  device.RunMs(3);
  device.Edge(1, true);
  const uint64_t contact = device.now();
  device.RunMs(3);
  HOLDS(device.DoArm(5, &second));
  HOLDS(first.ticks == second.ticks);
  Recall recall;
  recall.touch = 5;
  Recalled record;
  HOLDS(device.Ask(recall, &record));
  HOLDS(record.armed == 1 && record.fingers == 2 && record.contact_mask == 2 && record.ticks[1] == contact);
  return nullptr;
}

const char* EventsAreRepeatedUntilAcknowledged(const char*) {
  TestDevice device;
  HOLDS(device.DoConfigure(1, FingerConfig{}));
  HOLDS(device.DoArm(5));
  device.Edge(0, true);
  Event first, again;
  HOLDS(device.Take(&first));
  device.RunMs(49);
  HOLDS(!device.Take(&again));
  device.RunMs(1);
  HOLDS(device.Take(&again));
  HOLDS(again.number == first.number && again.ticks == first.ticks);
  device.RunMs(500);
  HOLDS(device.Count<Event>() == 10);
  device.DoAcknowledge(first.number);
  device.RunMs(500);
  HOLDS(device.Count<Event>() == 0);
  return nullptr;
}

const char* AnalogueCrossingsAreInterpolated(const char*) {
  TestDevice device;
  FingerConfig config;
  config.sensor = Sensor::kResistor;
  config.threshold = 500;
  config.hysteresis = 100;
  HOLDS(device.DoConfigure(1, config));
  HOLDS(device.DoArm(1));
  device.effector().OnAnalogue(0, 400, 2000);
  device.effector().OnAnalogue(0, 600, 3000);  // 500 half way
  Event event;
  HOLDS(device.Take(&event) && event.kind == EventKind::kContact && event.ticks == 2500);
  device.effector().OnAnalogue(0, 400, 4000);  // not below 400
  HOLDS(!device.Take(&event));
  device.effector().OnAnalogue(0, 450, 5000);
  device.effector().OnAnalogue(0, 250, 6000);  // 400 after a quarter
  HOLDS(device.Take(&event) && event.kind == EventKind::kRelease && event.ticks == 5250);
  return nullptr;
}

}  // namespace

const PortableCheck kPortableChecks[] = {
    {"CrcsHaveTheirPublishedValues", CrcsHaveTheirPublishedValues},
    {"EveryVectorAgreesBothWays", EveryVectorAgreesBothWays},
    {"NoFlippedBitPasses", NoFlippedBitPasses},
    {"NoTruncationPasses", NoTruncationPasses},
    {"TicksRunOnAcrossEveryWrap", TicksRunOnAcrossEveryWrap},
    {"ContactTimesAreRightAcrossTheWrap", ContactTimesAreRightAcrossTheWrap},
    {"BounceHasTheTimeOfItsFirstEdge", BounceHasTheTimeOfItsFirstEdge},
    {"ShortSpikesAreNoContact", ShortSpikesAreNoContact},
    {"ArmIsRefusedWhileAFingerIsPressed", ArmIsRefusedWhileAFingerIsPressed},
    {"RepeatedArmForgetsNothing", RepeatedArmForgetsNothing},
    {"EventsAreRepeatedUntilAcknowledged", EventsAreRepeatedUntilAcknowledged},
    {"AnalogueCrossingsAreInterpolated", AnalogueCrossingsAreInterpolated},
};
const int kPortableCheckCount = static_cast<int>(sizeof(kPortableChecks) / sizeof(kPortableChecks[0]));

}  // namespace touchstone::firmware
