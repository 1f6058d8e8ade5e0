#include "firmware/core/effector.h"

namespace touchstone::firmware {
namespace {

constexpr uint32_t kRepeatMs = 50;
constexpr uint32_t kHeartbeatMs = 250;
// An edge may be handled so long after it was captured: nothing settles before.
constexpr uint32_t kLateEdgeMs = 1;

constexpr uint8_t kFromDevice = 0x80;  // bit of the types that only the device sends

// Whether the length, without the check, is what the type asks for; `expected` is that length.
bool GoodLength(const uint8_t* payload, size_t size, size_t* expected) {
  switch (static_cast<Type>(payload[0])) {
    case Type::kHello:
      *expected = 6;
      break;
    case Type::kConfigure:
      *expected = 2;
      if (size >= 2) {
        // A wrong number of fingers is a wrong value.
        if (payload[1] < 1 || payload[1] > kMaxFingers) return true;
        *expected = 2 + size_t{10} * payload[1];
      }
      break;
    case Type::kArm:
    case Type::kClock:
    case Type::kAcknowledge:
    case Type::kRecall:
      *expected = 5;
      break;
    default:
      *expected = 1;
  }
  return size == *expected;
}

bool IsSame(const FingerConfig& a, const FingerConfig& b) {
  return a.sensor == b.sensor && a.active_level == b.active_level && a.debounce_us == b.debounce_us &&
         a.threshold == b.threshold && a.hysteresis == b.hysteresis;
}

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

void Effector::OnFrame(uint64_t received) {
  const uint8_t* payload = parser_.payload();
  const size_t size = parser_.size();
  const uint8_t type = payload[0];
  if (!IsIntact(payload, size)) {
    ++damaged_messages_;
    return;
  }
  // Our own messages, come back over a loop: an answer would go round for ever.
  if (type & kFromDevice) return;

  switch (static_cast<Type>(type)) {
    case Type::kHello: {
      Hello request;
      if (!Decode(payload, size, &request)) break;
      armed_ = false;
      record_.armed = 0;
      HelloReply reply;
      reply.nonce = request.nonce;
      reply.boot_id = identity_.boot_id;
      reply.tick_hz = identity_.tick_hz;
      for (size_t i = 0; i + 1 < sizeof(reply.firmware) && identity_.firmware[i] != 0; ++i) {
        reply.firmware[i] = identity_.firmware[i];
      }
      return Send(Encode(reply, payload_));
    }
    case Type::kConfigure: {
      Configure request;
      if (!Decode(payload, size, &request)) break;
      if (!OnConfigure(request)) return Refuse(type, RefusedReason::kBadValue, record_.touch);
      Configured reply;
      reply.fingers = request.fingers;
      return Send(Encode(reply, payload_));
    }
    case Type::kArm: {
      Arm request;
      if (!Decode(payload, size, &request)) break;
      return OnArm(request);
    }
    case Type::kDisarm: {
      Disarm request;
      if (!Decode(payload, size, &request)) break;
      armed_ = false;
      record_.armed = 0;
      return Send(Encode(Disarmed{}, payload_));
    }
    case Type::kClock: {
      Clock request;
      if (!Decode(payload, size, &request)) break;
      ClockReply reply;
      reply.query = request.query;
      reply.receive_ticks = received;
      reply.send_ticks = ReadTicks();
      return Send(Encode(reply, payload_));
    }
    case Type::kAcknowledge: {
      Acknowledge request;
      if (!Decode(payload, size, &request)) break;
      for (Slot& slot : slots_) {
        if (slot.event.number == request.number) slot.waiting = false;
      }
      return;
    }
    case Type::kRecall: {
      Recall request;
      if (!Decode(payload, size, &request)) break;
      if (record_.touch != request.touch) return Refuse(type, RefusedReason::kUnknownTouch, record_.touch);
      return Send(Encode(record_, payload_));
    }
    case Type::kStatusRequest: {
      StatusRequest request;
      if (!Decode(payload, size, &request)) break;
      return SendStatus(received);
    }
    default:
      return Refuse(type, RefusedReason::kUnknownType, 0);
  }
  size_t expected = 0;
  if (GoodLength(payload, size - kCheckSize, &expected)) return Refuse(type, RefusedReason::kBadValue, 0);
  Refuse(type, RefusedReason::kBadLength, static_cast<uint32_t>(expected));
}

bool Effector::OnConfigure(const Configure& request) {
  // The same again, a repeated request, changes nothing; another one in mid-touch would spoil the touch.
  bool same = request.fingers == finger_count_;
  for (int i = 0; same && i < request.fingers; ++i) same = IsSame(fingers_[i].config, request.finger[i]);
  if (same) return true;
  if (armed_) return false;

  finger_count_ = request.fingers;
  const uint64_t now = ReadTicks();
  for (int i = 0; i < finger_count_; ++i) {
    Finger& finger = fingers_[i];
    finger.config = request.finger[i];
    const bool active = finger.known && finger.pin == (finger.config.active_level != 0);
    finger.debouncer.Reset(active, HoldTicks(finger.config), now);
    finger.pressed = finger.sampled && finger.last_value >= finger.config.threshold;
  }
  return true;
}

void Effector::OnArm(const Arm& request) {
  if (finger_count_ == 0) {
    return Refuse(static_cast<uint8_t>(Type::kArm), RefusedReason::kNotConfigured, 0);
  }
  // The host repeats what it got no answer to: a touch that is armed stays as it is.
  if (!armed_ || record_.touch != request.touch) {
    const uint8_t mask = PressedMask();
    if (mask != 0) return Refuse(static_cast<uint8_t>(Type::kArm), RefusedReason::kPressed, mask);
    armed_ = true;
    armed_ticks_ = ReadTicks();
    // What an earlier attempt under the same name left behind would be taken for this one's.
    for (Slot& slot : slots_) {
      if (slot.event.touch == request.touch) slot.waiting = false;
    }
    record_ = Recalled{};
    record_.touch = request.touch;
    record_.armed = 1;
    record_.fingers = static_cast<uint8_t>(finger_count_);
    release_mask_ = 0;
    // Spikes before the touch lend their time to nothing in it.
    for (int i = 0; i < finger_count_; ++i) {
      fingers_[i].debouncer.Reset(false, HoldTicks(fingers_[i].config), armed_ticks_);
    }
  }
  Armed reply;
  reply.touch = request.touch;
  reply.ticks = armed_ticks_;
  Send(Encode(reply, payload_));
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

void Effector::Refuse(uint8_t type, RefusedReason reason, uint32_t detail) {
  Refused reply;
  reply.type = type;
  reply.reason = reason;
  reply.detail = detail;
  Send(Encode(reply, payload_));
}

void Effector::Send(size_t payload_size) {
  uint8_t frame[kMaxFrame];
  write_(context_, frame, EncodeFrame(payload_, payload_size, frame));
}

}  // namespace touchstone::firmware
