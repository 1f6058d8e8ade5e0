// The end effector's answers to what the host asks.
#include "firmware/core/effector.h"

namespace touchstone::firmware {
namespace {

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

}  // namespace

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

void Effector::Refuse(uint8_t type, RefusedReason reason, uint32_t detail) {
  Refused reply;
  reply.type = type;
  reply.reason = reason;
  reply.detail = detail;
  Send(Encode(reply, payload_));
}

}  // namespace touchstone::firmware
