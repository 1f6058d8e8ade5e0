#include "firmware/core/messages.h"

namespace touchstone::firmware {
namespace {

// Appends little-endian fields to a payload.
class Writer {
 public:
  Writer(Type type, uint8_t* out) : out_(out) { Put(static_cast<uint8_t>(type)); }
  template <typename Integer>
  Writer& Put(Integer value) {
    uint64_t rest = static_cast<uint64_t>(value);
    for (size_t i = 0; i < sizeof(Integer); ++i, rest >>= 8)
      out_[size_++] = static_cast<uint8_t>(rest & 0xFF);
    return *this;
  }
  // Ends the message with its check; returns the size.
  size_t Finish() {
    Put(Crc32(out_, size_));
    return size_;
  }

 private:
  uint8_t* out_;
  size_t size_ = 0;
};

// Takes them off again. Whether they fitted is asked once, at the end.
class Reader {
 public:
  Reader(Type type, const uint8_t* payload, size_t size) : payload_(payload) {
    good_ = IsIntact(payload, size);
    size_ = good_ ? size - kCheckSize : 0;
    uint8_t first = 0;
    Get(&first);
    good_ = good_ && first == static_cast<uint8_t>(type);
  }
  template <typename Integer>
  Reader& Get(Integer* value) {
    if (!good_ || size_ - at_ < sizeof(Integer)) {
      good_ = false;
      return *this;
    }
    uint64_t result = 0;
    for (size_t i = 0; i < sizeof(Integer); ++i) result |= static_cast<uint64_t>(payload_[at_++]) << (8 * i);
    *value = static_cast<Integer>(result);
    return *this;
  }
  bool Done() const { return good_ && at_ == size_; }

 private:
  const uint8_t* payload_;
  size_t size_ = 0;
  size_t at_ = 0;
  bool good_ = true;
};

bool GoodTicks(uint64_t ticks) {
  return ticks <= kMaxTicks;
}

bool GoodFingers(uint8_t fingers) {
  return fingers >= 1 && fingers <= kMaxFingers;
}

bool GoodFinger(const FingerConfig& finger) {
  if (finger.active_level > 1 || finger.debounce_us > kMaxDebounceUs) return false;
  if (finger.sensor > Sensor::kResistor) return false;
  return finger.sensor != Sensor::kResistor || finger.hysteresis < finger.threshold;
}

// Printable, ended by a zero, zeros behind it.
bool GoodName(const char (&name)[24]) {
  size_t length = 0;
  while (length < sizeof(name) && name[length] >= ' ' && name[length] <= '~') ++length;
  if (length == sizeof(name)) return false;
  for (size_t i = length; i < sizeof(name); ++i) {
    if (name[i] != 0) return false;
  }
  return true;
}

template <typename Message>
bool Accept(bool good, const Message& result, Message* message) {
  if (good) *message = result;
  return good;
}

}  // namespace

uint32_t Crc32(const uint8_t* data, size_t size) {
  uint32_t crc = 0xFFFFFFFF;
  for (size_t i = 0; i < size; ++i) {
    crc ^= data[i];
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (crc & 1 ? 0xEDB88320 : 0);
  }
  return ~crc;
}

bool IsIntact(const uint8_t* payload, size_t size) {
  if (size < 1 + kCheckSize) return false;
  const uint8_t* check = payload + size - kCheckSize;
  uint32_t sent = 0;
  for (size_t i = kCheckSize; i-- > 0;) sent = sent << 8 | check[i];
  return sent == Crc32(payload, size - kCheckSize);
}

size_t Encode(const Hello& m, uint8_t* out) {
  return Writer(Type::kHello, out).Put(m.version).Put(m.nonce).Finish();
}
bool Decode(const uint8_t* payload, size_t size, Hello* message) {
  Hello m;
  const bool good = Reader(Type::kHello, payload, size).Get(&m.version).Get(&m.nonce).Done();
  return Accept(good, m, message);
}

size_t Encode(const HelloReply& m, uint8_t* out) {
  Writer writer(Type::kHelloReply, out);
  writer.Put(m.version).Put(m.nonce).Put(m.boot_id).Put(m.tick_hz).Put(m.max_fingers);
  for (char letter : m.firmware) writer.Put(static_cast<uint8_t>(letter));
  return writer.Finish();
}
bool Decode(const uint8_t* payload, size_t size, HelloReply* message) {
  HelloReply m;
  Reader reader(Type::kHelloReply, payload, size);
  reader.Get(&m.version).Get(&m.nonce).Get(&m.boot_id).Get(&m.tick_hz).Get(&m.max_fingers);
  for (char& letter : m.firmware) {
    uint8_t byte = 0;
    reader.Get(&byte);
    letter = static_cast<char>(byte);
  }
  return Accept(reader.Done() && m.tick_hz > 0 && GoodFingers(m.max_fingers) && GoodName(m.firmware), m,
                message);
}

size_t Encode(const Configure& m, uint8_t* out) {
  Writer writer(Type::kConfigure, out);
  writer.Put(m.fingers);
  for (int i = 0; i < m.fingers && i < kMaxFingers; ++i) {
    const FingerConfig& finger = m.finger[i];
    writer.Put(static_cast<uint8_t>(finger.sensor)).Put(finger.active_level).Put(finger.debounce_us);
    writer.Put(finger.threshold).Put(finger.hysteresis);
  }
  return writer.Finish();
}
bool Decode(const uint8_t* payload, size_t size, Configure* message) {
  Configure m;
  Reader reader(Type::kConfigure, payload, size);
  reader.Get(&m.fingers);
  if (!GoodFingers(m.fingers)) return false;
  bool good = true;
  for (int i = 0; i < m.fingers; ++i) {
    FingerConfig& finger = m.finger[i];
    uint8_t sensor = 0;
    reader.Get(&sensor).Get(&finger.active_level).Get(&finger.debounce_us);
    reader.Get(&finger.threshold).Get(&finger.hysteresis);
    finger.sensor = static_cast<Sensor>(sensor);
    good = good && GoodFinger(finger);
  }
  return Accept(good && reader.Done(), m, message);
}

size_t Encode(const Configured& m, uint8_t* out) {
  return Writer(Type::kConfigured, out).Put(m.fingers).Finish();
}
bool Decode(const uint8_t* payload, size_t size, Configured* message) {
  Configured m;
  const bool good = Reader(Type::kConfigured, payload, size).Get(&m.fingers).Done();
  return Accept(good && GoodFingers(m.fingers), m, message);
}

size_t Encode(const Arm& m, uint8_t* out) {
  return Writer(Type::kArm, out).Put(m.touch).Finish();
}
bool Decode(const uint8_t* payload, size_t size, Arm* message) {
  Arm m;
  const bool good = Reader(Type::kArm, payload, size).Get(&m.touch).Done();
  return Accept(good && m.touch != kNoTouch, m, message);
}

size_t Encode(const Armed& m, uint8_t* out) {
  return Writer(Type::kArmed, out).Put(m.touch).Put(m.ticks).Finish();
}
bool Decode(const uint8_t* payload, size_t size, Armed* message) {
  Armed m;
  const bool good = Reader(Type::kArmed, payload, size).Get(&m.touch).Get(&m.ticks).Done();
  return Accept(good && m.touch != kNoTouch && GoodTicks(m.ticks), m, message);
}

size_t Encode(const Disarm&, uint8_t* out) {
  return Writer(Type::kDisarm, out).Finish();
}
bool Decode(const uint8_t* payload, size_t size, Disarm* message) {
  return Accept(Reader(Type::kDisarm, payload, size).Done(), Disarm{}, message);
}

size_t Encode(const Disarmed&, uint8_t* out) {
  return Writer(Type::kDisarmed, out).Finish();
}
bool Decode(const uint8_t* payload, size_t size, Disarmed* message) {
  return Accept(Reader(Type::kDisarmed, payload, size).Done(), Disarmed{}, message);
}

size_t Encode(const Clock& m, uint8_t* out) {
  return Writer(Type::kClock, out).Put(m.query).Finish();
}
bool Decode(const uint8_t* payload, size_t size, Clock* message) {
  Clock m;
  const bool good = Reader(Type::kClock, payload, size).Get(&m.query).Done();
  return Accept(good, m, message);
}

size_t Encode(const ClockReply& m, uint8_t* out) {
  return Writer(Type::kClockReply, out).Put(m.query).Put(m.receive_ticks).Put(m.send_ticks).Finish();
}
bool Decode(const uint8_t* payload, size_t size, ClockReply* message) {
  ClockReply m;
  Reader reader(Type::kClockReply, payload, size);
  const bool good = reader.Get(&m.query).Get(&m.receive_ticks).Get(&m.send_ticks).Done();
  return Accept(good && GoodTicks(m.send_ticks) && m.receive_ticks <= m.send_ticks, m, message);
}

size_t Encode(const Event& m, uint8_t* out) {
  Writer writer(Type::kEvent, out);
  writer.Put(m.number).Put(m.touch).Put(m.finger).Put(static_cast<uint8_t>(m.kind)).Put(m.ticks);
  return writer.Finish();
}
bool Decode(const uint8_t* payload, size_t size, Event* message) {
  Event m;
  uint8_t kind = 0;
  Reader reader(Type::kEvent, payload, size);
  const bool good = reader.Get(&m.number).Get(&m.touch).Get(&m.finger).Get(&kind).Get(&m.ticks).Done();
  m.kind = static_cast<EventKind>(kind);
  return Accept(good && m.number != 0 && m.touch != kNoTouch && m.finger < kMaxFingers &&
                    (m.kind == EventKind::kContact || m.kind == EventKind::kRelease) && GoodTicks(m.ticks),
                m, message);
}

size_t Encode(const Acknowledge& m, uint8_t* out) {
  return Writer(Type::kAcknowledge, out).Put(m.number).Finish();
}
bool Decode(const uint8_t* payload, size_t size, Acknowledge* message) {
  Acknowledge m;
  const bool good = Reader(Type::kAcknowledge, payload, size).Get(&m.number).Done();
  return Accept(good && m.number != 0, m, message);
}

size_t Encode(const Recall& m, uint8_t* out) {
  return Writer(Type::kRecall, out).Put(m.touch).Finish();
}
bool Decode(const uint8_t* payload, size_t size, Recall* message) {
  Recall m;
  const bool good = Reader(Type::kRecall, payload, size).Get(&m.touch).Done();
  return Accept(good && m.touch != kNoTouch, m, message);
}

size_t Encode(const Recalled& m, uint8_t* out) {
  Writer writer(Type::kRecalled, out);
  writer.Put(m.touch).Put(m.armed).Put(m.fingers).Put(m.contact_mask);
  for (int i = 0; i < m.fingers && i < kMaxFingers; ++i) writer.Put(m.ticks[i]);
  return writer.Finish();
}
bool Decode(const uint8_t* payload, size_t size, Recalled* message) {
  Recalled m;
  Reader reader(Type::kRecalled, payload, size);
  reader.Get(&m.touch).Get(&m.armed).Get(&m.fingers).Get(&m.contact_mask);
  if (!GoodFingers(m.fingers)) return false;
  bool good = m.touch != kNoTouch && m.armed <= 1 && m.contact_mask >> m.fingers == 0;
  for (int i = 0; i < m.fingers; ++i) {
    reader.Get(&m.ticks[i]);
    // A finger without contact has no time.
    good = good && GoodTicks(m.ticks[i]) && (m.contact_mask >> i & 1 || m.ticks[i] == 0);
  }
  return Accept(good && reader.Done(), m, message);
}

size_t Encode(const StatusRequest&, uint8_t* out) {
  return Writer(Type::kStatusRequest, out).Finish();
}
bool Decode(const uint8_t* payload, size_t size, StatusRequest* message) {
  return Accept(Reader(Type::kStatusRequest, payload, size).Done(), StatusRequest{}, message);
}

size_t Encode(const Status& m, uint8_t* out) {
  Writer writer(Type::kStatus, out);
  writer.Put(m.boot_id).Put(m.ticks).Put(m.touch).Put(m.pressed_mask).Put(m.bad_frames).Put(m.lost_events);
  return writer.Finish();
}
bool Decode(const uint8_t* payload, size_t size, Status* message) {
  Status m;
  Reader reader(Type::kStatus, payload, size);
  reader.Get(&m.boot_id)
      .Get(&m.ticks)
      .Get(&m.touch)
      .Get(&m.pressed_mask)
      .Get(&m.bad_frames)
      .Get(&m.lost_events);
  return Accept(reader.Done() && GoodTicks(m.ticks), m, message);
}

size_t Encode(const Refused& m, uint8_t* out) {
  return Writer(Type::kRefused, out).Put(m.type).Put(static_cast<uint8_t>(m.reason)).Put(m.detail).Finish();
}
bool Decode(const uint8_t* payload, size_t size, Refused* message) {
  Refused m;
  uint8_t reason = 0;
  const bool good = Reader(Type::kRefused, payload, size).Get(&m.type).Get(&reason).Get(&m.detail).Done();
  m.reason = static_cast<RefusedReason>(reason);
  return Accept(good && m.reason >= RefusedReason::kUnknownType && m.reason <= RefusedReason::kUnknownTouch,
                m, message);
}

}  // namespace touchstone::firmware
