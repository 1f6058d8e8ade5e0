// The end effector without its hardware: bytes, edges and time go in, frames come out. No heap, no
// exceptions, no clock of its own; one thread (or interrupts off) calls everything.
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/core/debouncer.h"
#include "firmware/core/frame.h"
#include "firmware/core/messages.h"
#include "firmware/core/ticks.h"

namespace touchstone::firmware {

struct Identity {
  uint32_t boot_id = 0;
  uint32_t tick_hz = 1000000;
  uint8_t tick_bits = 32;               // of the readings given below
  const char* firmware = "touchstone";  // at most 23 characters
};

class Effector {
 public:
  // Writes one whole frame to the line; may block for as long as the line takes.
  using Write = void (*)(void* context, const uint8_t* frame, size_t size);

  // `write` and `now` (a reading of the counter) are called from inside the functions below.
  using Now = uint32_t (*)(void* context);
  Effector(const Identity& identity, Write write, Now now, void* context);

  void OnByte(uint8_t byte);
  // A pin changed: its new level, and the reading that the hardware captured at the edge. Tell every pin's
  // level once at the start; until then the finger is taken as released. Edges of one finger come in their
  // order; a level that is no change is ignored.
  void OnEdge(int finger, bool level, uint32_t reading);
  // A sample of an analogue finger; the crossing's time is interpolated between two samples.
  void OnAnalogue(int finger, uint16_t value, uint32_t reading);
  // Repeats, heartbeat, debouncing, wrap-around: at least every millisecond. Writes three frames at most.
  void OnTime();

 private:
  struct Finger {
    FingerConfig config;
    bool known = false;  // the pin's level was reported
    bool pin = false;
    Debouncer debouncer;   // optical (which holds at once), microswitch
    bool pressed = false;  // resistor
    bool sampled = false;
    uint16_t last_value = 0;
    uint64_t last_sample = 0;
  };
  struct Slot {
    Event event;
    bool waiting = false;  // for its acknowledgement
    uint64_t sent = 0;
  };
  // A touch makes 2 * kMaxFingers events at most; as many more may wait from touches before.
  static constexpr int kSlots = 4 * kMaxFingers;

  uint64_t ReadTicks() { return ticks_.Extend(now_(context_)); }
  void OnFrame(uint64_t received);
  bool OnConfigure(const Configure& request);
  void OnArm(const Arm& request);
  uint64_t HoldTicks(const FingerConfig& config) const;
  bool IsPressed(const Finger& finger) const;
  uint8_t PressedMask() const;
  void OnChange(int finger, const Debouncer::Change& change);
  void Record(int finger, EventKind kind, uint64_t ticks);
  Slot* FreeSlot();
  void SendEvent(Slot* slot);
  void SendStatus(uint64_t now);
  void Refuse(uint8_t type, RefusedReason reason, uint32_t detail);
  void Send(size_t payload_size);  // what stands in payload_

  Identity identity_;
  Write write_;
  Now now_;
  void* context_;
  TickExtender ticks_;
  FrameParser parser_;
  uint32_t damaged_messages_ = 0;  // in good frames

  int finger_count_ = 0;  // 0: not configured
  Finger fingers_[kMaxFingers];

  bool armed_ = false;
  uint64_t armed_ticks_ = 0;
  Recalled record_;  // touch 0: none yet
  uint8_t release_mask_ = 0;

  Slot slots_[kSlots];
  uint32_t last_number_ = 0;
  uint32_t lost_events_ = 0;
  uint64_t status_sent_ = 0;
  uint8_t payload_[kMaxPayload];
};

}  // namespace touchstone::firmware
