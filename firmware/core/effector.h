// The end effector without its hardware: bytes, edges and time go in, frames come out. No heap, no exceptions, no
// clock of its own; one thread (or interrupts off) calls everything.
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/core/frame.h"
#include "firmware/core/messages.h"
#include "firmware/core/ticks.h"

namespace touchstone::firmware {

struct Identity {
  uint32_t boot_id = 0;
  uint32_t tick_hz = 1000000;
  uint8_t tick_bits = 32;            // of the readings given below
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
  // A pin changed: its new level, and the reading that the hardware captured at the edge.
  void OnEdge(int finger, bool level, uint32_t reading);
  // A sample of an analogue finger; the crossing's time is interpolated between two samples.
  void OnAnalogue(int finger, uint16_t value, uint32_t reading);
  // Repeats, heartbeat, debouncing, wrap-around: at least every millisecond.
  void OnTime();

  // The rest is the implementation's.
 private:
  struct Finger {
    FingerConfig config;
    bool level = false;      // of the pin, active or not, before debouncing
    bool pressed = false;    // after it
    uint64_t changed = 0;    // ticks of the first edge of the change under way
    bool changing = false;
    uint16_t last_value = 0;
    uint64_t last_sample = 0;
    bool has_sample = false;
  };
  struct Slot {
    Event event;
    bool waiting = false;    // for its acknowledgement
    uint64_t sent = 0;
  };
  // To be completed by effector.cpp's author.
  Identity identity_;
  Write write_;
  Now now_;
  void* context_;
  TickExtender ticks_;
  FrameParser parser_;
  Finger fingers_[kMaxFingers];
  Slot slots_[2 * kMaxFingers];  // contact and release of every finger
  Recalled record_;
};

}  // namespace touchstone::firmware
