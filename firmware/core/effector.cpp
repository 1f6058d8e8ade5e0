// What the end effector senses, and what it reports of itself; effector_requests.cpp answers the host.
#include "firmware/core/effector.h"

namespace touchstone::firmware {
namespace {

constexpr uint32_t kRepeatMs = 50;
constexpr uint32_t kHeartbeatMs = 250;
// An edge may be handled so long after it was captured: nothing settles before.
constexpr uint32_t kLateEdgeMs = 1;

// Between two samples on both sides of `level`, the moment at which a straight line crosses it.
uint64_t Crossing(uint64_t from, uint16_t from_value, uint64_t to, uint16_t to_value, uint16_t level) {
  if (to <= from) return to;
  const uint32_t whole = from_value < to_value ? to_value - from_value : from_value - to_value;
  const uint32_t part = from_value < level ? level - from_value : from_value - level;
  return from + (to - from) * part / whole;
}

}  // namespace

Effector::Effector(const Identity& identity, Write write, Now now, void* context)
    : identity_(identity), write_(write), now_(now), context_(context), ticks_(identity.tick_bits) {}

void Effector::OnByte(uint8_t byte) {
  if (parser_.Push(byte)) OnFrame(ReadTicks());
}

void Effector::OnEdge(int index, bool level, uint32_t reading) {
  const uint64_t ticks = ticks_.Extend(reading);
  if (index < 0 || index >= kMaxFingers) return;
  Finger& finger = fingers_[index];
  const bool first = !finger.known;
  finger.known = true;
  finger.pin = level;
  if (index >= finger_count_ || finger.config.sensor == Sensor::kResistor) return;
  const bool active = level == (finger.config.active_level != 0);
  // The first level that is heard of outside a touch is how the pin stands, not a change.
  if (first && !armed_) {
    finger.debouncer.Reset(active, HoldTicks(finger.config), ticks);
    return;
  }
  OnChange(index, finger.debouncer.OnEdge(active, ticks));
}

void Effector::OnAnalogue(int index, uint16_t value, uint32_t reading) {
  const uint64_t ticks = ticks_.Extend(reading);
  if (index < 0 || index >= kMaxFingers) return;
  Finger& finger = fingers_[index];
  const bool had_sample = finger.sampled;
  const uint16_t last_value = finger.last_value;
  const uint64_t last_sample = finger.last_sample;
  finger.sampled = true;
  finger.last_value = value;
  finger.last_sample = ticks;
  if (index >= finger_count_ || finger.config.sensor != Sensor::kResistor) return;

  const uint16_t press_at = finger.config.threshold;
  const uint16_t release_below = static_cast<uint16_t>(press_at - finger.config.hysteresis);
  const bool pressed = finger.pressed ? value >= release_below : value >= press_at;
  if (pressed == finger.pressed) return;
  finger.pressed = pressed;
  Debouncer::Change change;
  change.changed = true;
  change.ticks = ticks;
  if (had_sample) {
    change.ticks = Crossing(last_sample, last_value, ticks, value, pressed ? press_at : release_below);
  }
  OnChange(index, change);
}

void Effector::OnTime() {
  const uint64_t now = ReadTicks();

  // Switches settle, up to a moment whose edges have all been handled.
  const uint64_t late = uint64_t{kLateEdgeMs} * identity_.tick_hz / 1000;
  for (int i = 0; i < finger_count_; ++i) {
    if (fingers_[i].config.sensor == Sensor::kResistor || now < late) continue;
    OnChange(i, fingers_[i].debouncer.Advance(now - late));
  }

  // One event again, the one that has waited longest: a full line must not hold up the fingers.
  Slot* longest = nullptr;
  for (Slot& slot : slots_) {
    if (slot.waiting && (longest == nullptr || slot.sent < longest->sent)) longest = &slot;
  }
  if (longest != nullptr && now >= longest->sent + uint64_t{kRepeatMs} * identity_.tick_hz / 1000) {
    SendEvent(longest);
  }

  if (now >= status_sent_ + uint64_t{kHeartbeatMs} * identity_.tick_hz / 1000) SendStatus(now);
}

uint64_t Effector::HoldTicks(const FingerConfig& config) const {
  // An optical interrupter does not bounce.
  if (config.sensor == Sensor::kOptical) return 0;
  return uint64_t{config.debounce_us} * identity_.tick_hz / 1000000;
}

bool Effector::IsPressed(const Finger& finger) const {
  if (finger.config.sensor == Sensor::kResistor) return finger.pressed;
  return finger.debouncer.settled() || finger.debouncer.level();
}

uint8_t Effector::PressedMask() const {
  uint8_t mask = 0;
  for (int i = 0; i < finger_count_; ++i) {
    if (IsPressed(fingers_[i])) mask = static_cast<uint8_t>(mask | 1u << i);
  }
  return mask;
}

void Effector::OnChange(int index, const Debouncer::Change& change) {
  if (!change.changed || !armed_ || index >= record_.fingers) return;
  const Finger& finger = fingers_[index];
  const bool pressed =
      finger.config.sensor == Sensor::kResistor ? finger.pressed : finger.debouncer.settled();
  const uint8_t bit = static_cast<uint8_t>(1u << index);
  if (pressed && !(record_.contact_mask & bit)) {
    // Captured before the touch began, handled after: not a contact of it.
    if (change.ticks < armed_ticks_) return;
    record_.contact_mask = static_cast<uint8_t>(record_.contact_mask | bit);
    record_.ticks[index] = change.ticks;
    Record(index, EventKind::kContact, change.ticks);
  } else if (!pressed && (record_.contact_mask & bit) && !(release_mask_ & bit)) {
    release_mask_ = static_cast<uint8_t>(release_mask_ | bit);
    Record(index, EventKind::kRelease, change.ticks);
  }
}

void Effector::Record(int finger, EventKind kind, uint64_t ticks) {
  Slot* slot = FreeSlot();
  slot->waiting = true;
  slot->event.number = ++last_number_;
  slot->event.touch = record_.touch;
  slot->event.finger = static_cast<uint8_t>(finger);
  slot->event.kind = kind;
  slot->event.ticks = ticks;
  SendEvent(slot);
}

Effector::Slot* Effector::FreeSlot() {
  // If none is free, the oldest event goes: one of another touch, since one touch never needs them all.
  Slot* oldest = &slots_[0];
  for (Slot& slot : slots_) {
    if (!slot.waiting) return &slot;
    if (slot.event.number < oldest->event.number) oldest = &slot;
  }
  ++lost_events_;
  return oldest;
}

void Effector::SendEvent(Slot* slot) {
  slot->sent = ReadTicks();
  Send(Encode(slot->event, payload_));
}

void Effector::SendStatus(uint64_t now) {
  status_sent_ = now;
  Status status;
  status.boot_id = identity_.boot_id;
  status.ticks = now;
  status.touch = armed_ ? record_.touch : kNoTouch;
  status.pressed_mask = PressedMask();
  status.bad_frames = parser_.bad_frames() + damaged_messages_;
  status.lost_events = lost_events_;
  Send(Encode(status, payload_));
}

void Effector::Send(size_t payload_size) {
  uint8_t frame[kMaxFrame];
  write_(context_, frame, EncodeFrame(payload_, payload_size, frame));
}

}  // namespace touchstone::firmware
