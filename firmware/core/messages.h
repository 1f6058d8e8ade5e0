// The messages of the serial line (PROTOCOL.md): one a frame: u8 type, then the fields in the order given
// here, little endian, packed; of an array with one entry per finger only as many as there are fingers; then
// u32 check. Both ends use these functions.
#pragma once

#include <cstddef>
#include <cstdint>

namespace touchstone::firmware {

constexpr uint8_t kProtocolVersion = 1;
constexpr int kMaxFingers = 8;
constexpr uint8_t kNoTouch = 0;  // touch ids are never 0
constexpr uint64_t kMaxTicks =
    (uint64_t{1} << 53) - 1;  // 17 years at 16 MHz; later ones are refused by Decode
constexpr uint32_t kMaxDebounceUs = 1000000;

// The check at the end of every message: CRC-32 (reflected 0x04C11DB7, start and end inverted; "123456789"
// gives 0xCBF43926) of all before it. The frame's CRC-16 alone lets 1 damaged frame in 65,536 through; both,
// 1 in 2^48.
constexpr size_t kCheckSize = 4;
uint32_t Crc32(const uint8_t* data, size_t size);
// Whether the payload ends with its check: what does not is damage, whatever its type.
bool IsIntact(const uint8_t* payload, size_t size);

enum class Type : uint8_t {
  // Host to device.
  kHello = 0x01,
  kConfigure = 0x02,
  kArm = 0x03,
  kDisarm = 0x04,
  kClock = 0x05,
  kAcknowledge = 0x06,
  kRecall = 0x07,
  kStatusRequest = 0x08,
  // Device to host.
  kHelloReply = 0x81,
  kConfigured = 0x82,
  kArmed = 0x83,
  kDisarmed = 0x84,
  kClockReply = 0x85,
  kEvent = 0x86,
  kRecalled = 0x87,
  kStatus = 0x88,
  kRefused = 0x8F,
};

enum class Sensor : uint8_t { kOptical = 0, kMicroswitch = 1, kResistor = 2 };

struct FingerConfig {
  Sensor sensor = Sensor::kOptical;
  uint8_t active_level = 1;  // the pin's level while pressed: optical, microswitch
  // Microswitch, at most kMaxDebounceUs: a press counts once the pin has been active for this much
  // longer than inactive; its time is that of the first edge of the bounce, which lasts no longer than
  // this either (debouncer.h).
  uint32_t debounce_us = 0;
  uint16_t threshold = 512;  // resistor: pressed at or above
  uint16_t hysteresis = 16;  // resistor: released below threshold - hysteresis; less than the threshold
};

enum class EventKind : uint8_t { kContact = 1, kRelease = 2 };

enum class RefusedReason : uint8_t {
  kUnknownType = 1,
  kBadLength = 2,
  kBadValue = 3,
  kNotConfigured = 4,
  kPressed = 5,      // detail: mask of fingers that are pressed before the touch
  kUnknownTouch = 6  // Recall of another touch than the last
};

// Asks who is there; every device state but the last touch's record is as after Disarm.
struct Hello {
  uint8_t version = kProtocolVersion;
  uint32_t nonce = 0;
};
struct HelloReply {
  uint8_t version = kProtocolVersion;
  uint32_t nonce = 0;    // the Hello's
  uint32_t boot_id = 0;  // another one after every reset
  uint32_t tick_hz = 0;  // nominal
  uint8_t max_fingers = kMaxFingers;
  char firmware[24] = {};  // "nano33ble 0.1.0", zero-terminated
};

struct Configure {
  uint8_t fingers = 0;  // 1 to kMaxFingers
  FingerConfig finger[kMaxFingers];
};
struct Configured {
  uint8_t fingers = 0;
};

// Begins a touch: from now on the first contact of every finger is kept and sent until it is acknowledged.
struct Arm {
  uint32_t touch = 0;
};
struct Armed {
  uint32_t touch = 0;
  uint64_t ticks = 0;  // since when
};
struct Disarm {};
struct Disarmed {};

// The two inner time stamps of a round trip; the host has the outer two.
struct Clock {
  uint32_t query = 0;
};
struct ClockReply {
  uint32_t query = 0;
  uint64_t receive_ticks = 0;  // when the last byte of Clock was read
  uint64_t send_ticks = 0;     // just before the first byte of this was written
};

// A finger's first contact, or its first release after it, of the armed touch. Sent again every 50 ms until
// it is acknowledged.
struct Event {
  uint32_t number = 0;  // counts from 1 since reset; with the boot id the event's name
  uint32_t touch = 0;
  uint8_t finger = 0;
  EventKind kind = EventKind::kContact;
  uint64_t ticks = 0;
};
struct Acknowledge {
  uint32_t number = 0;
};

// The record of the last touch, kept until the next Arm, across Hello and host restarts.
struct Recall {
  uint32_t touch = 0;
};
struct Recalled {
  uint32_t touch = 0;
  uint8_t armed = 0;  // 1: still going on
  uint8_t fingers = 0;
  uint8_t contact_mask = 0;          // bit i: finger i made contact
  uint64_t ticks[kMaxFingers] = {};  // its contact
};

// Sent on request, and by itself every 250 ms: the heartbeat.
struct StatusRequest {};
struct Status {
  uint32_t boot_id = 0;
  uint64_t ticks = 0;
  uint32_t touch = 0;  // the armed one; 0: none
  uint8_t pressed_mask = 0;
  uint32_t bad_frames = 0;   // received
  uint32_t lost_events = 0;  // not kept for lack of room: always 0 unless something is broken
};

struct Refused {
  uint8_t type = 0;  // of the message refused
  RefusedReason reason = RefusedReason::kBadValue;
  uint32_t detail = 0;
};

// Encode writes the payload and returns its size; `out` has room for kMaxPayload bytes. Decode returns false
// if the type, the length or the check is wrong or a value is out of its range, and then leaves `message`
// alone. TypeOf is the first byte.
#define TOUCHSTONE_FIRMWARE_MESSAGE(Name)           \
  size_t Encode(const Name& message, uint8_t* out); \
  bool Decode(const uint8_t* payload, size_t size, Name* message)
TOUCHSTONE_FIRMWARE_MESSAGE(Hello);
TOUCHSTONE_FIRMWARE_MESSAGE(HelloReply);
TOUCHSTONE_FIRMWARE_MESSAGE(Configure);
TOUCHSTONE_FIRMWARE_MESSAGE(Configured);
TOUCHSTONE_FIRMWARE_MESSAGE(Arm);
TOUCHSTONE_FIRMWARE_MESSAGE(Armed);
TOUCHSTONE_FIRMWARE_MESSAGE(Disarm);
TOUCHSTONE_FIRMWARE_MESSAGE(Disarmed);
TOUCHSTONE_FIRMWARE_MESSAGE(Clock);
TOUCHSTONE_FIRMWARE_MESSAGE(ClockReply);
TOUCHSTONE_FIRMWARE_MESSAGE(Event);
TOUCHSTONE_FIRMWARE_MESSAGE(Acknowledge);
TOUCHSTONE_FIRMWARE_MESSAGE(Recall);
TOUCHSTONE_FIRMWARE_MESSAGE(Recalled);
TOUCHSTONE_FIRMWARE_MESSAGE(StatusRequest);
TOUCHSTONE_FIRMWARE_MESSAGE(Status);
TOUCHSTONE_FIRMWARE_MESSAGE(Refused);
#undef TOUCHSTONE_FIRMWARE_MESSAGE

}  // namespace touchstone::firmware
