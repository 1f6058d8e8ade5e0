#include "firmware/core/vectors.h"

#include <cstdlib>
#include <cstring>

#include "firmware/core/frame.h"

namespace touchstone::firmware {
namespace {

// The fields of every message once more, in the order of the wire.
template <typename V>
void Fields(Hello& m, V& v) {
  v("version", m.version), v("nonce", m.nonce);
}
template <typename V>
void Fields(HelloReply& m, V& v) {
  v("version", m.version), v("nonce", m.nonce), v("boot_id", m.boot_id), v("tick_hz", m.tick_hz);
  v("max_fingers", m.max_fingers), v("firmware", m.firmware);
}
template <typename V>
void Fields(Configure& m, V& v) {
  v("fingers", m.fingers);
  for (int i = 0; i < m.fingers && i < kMaxFingers; ++i) {
    FingerConfig& f = m.finger[i];
    v("sensor", f.sensor), v("active_level", f.active_level), v("debounce_us", f.debounce_us);
    v("threshold", f.threshold), v("hysteresis", f.hysteresis);
  }
}
template <typename V>
void Fields(Configured& m, V& v) {
  v("fingers", m.fingers);
}
template <typename V>
void Fields(Arm& m, V& v) {
  v("touch", m.touch);
}
template <typename V>
void Fields(Armed& m, V& v) {
  v("touch", m.touch), v("ticks", m.ticks);
}
template <typename V>
void Fields(Disarm&, V&) {}
template <typename V>
void Fields(Disarmed&, V&) {}
template <typename V>
void Fields(Clock& m, V& v) {
  v("query", m.query);
}
template <typename V>
void Fields(ClockReply& m, V& v) {
  v("query", m.query), v("receive_ticks", m.receive_ticks), v("send_ticks", m.send_ticks);
}
template <typename V>
void Fields(Event& m, V& v) {
  v("number", m.number), v("touch", m.touch), v("finger", m.finger), v("kind", m.kind), v("ticks", m.ticks);
}
template <typename V>
void Fields(Acknowledge& m, V& v) {
  v("number", m.number);
}
template <typename V>
void Fields(Recall& m, V& v) {
  v("touch", m.touch);
}
template <typename V>
void Fields(Recalled& m, V& v) {
  v("touch", m.touch), v("armed", m.armed), v("fingers", m.fingers), v("contact_mask", m.contact_mask);
  for (int i = 0; i < m.fingers && i < kMaxFingers; ++i) v("ticks", m.ticks[i]);
}
template <typename V>
void Fields(StatusRequest&, V&) {}
template <typename V>
void Fields(Status& m, V& v) {
  v("boot_id", m.boot_id), v("ticks", m.ticks), v("touch", m.touch), v("pressed_mask", m.pressed_mask);
  v("bad_frames", m.bad_frames), v("lost_events", m.lost_events);
}
template <typename V>
void Fields(Refused& m, V& v) {
  v("type", m.type), v("reason", m.reason), v("detail", m.detail);
}

// Fills a message from a vector, or compares the two.
class Filler {
 public:
  explicit Filler(const Vector& vector) : vector_(vector) {}
  template <typename Value>
  void operator()(const char* name, Value& value) {
    const Vector::Field* field = Next(name, sizeof(Value));
    if (field != nullptr) value = static_cast<Value>(field->value);
  }
  void operator()(const char* name, char (&text)[24]) {
    const Vector::Field* field = Next(name, 24);
    if (field != nullptr) std::memcpy(text, field->text, 24);
  }
  bool good() const { return good_ && at_ == vector_.field_count; }

 protected:
  const Vector::Field* Next(const char* name, size_t width_bytes) {
    const Vector::Field* field = at_ < vector_.field_count ? &vector_.fields[at_++] : nullptr;
    good_ = good_ && field != nullptr && std::strcmp(field->name, name) == 0 &&
            field->width_bytes == static_cast<int>(width_bytes);
    return good_ ? field : nullptr;
  }
  const Vector& vector_;
  int at_ = 0;
  bool good_ = true;
};

class Comparer : public Filler {
 public:
  using Filler::Filler;
  template <typename Value>
  void operator()(const char* name, Value& value) {
    const Vector::Field* field = Next(name, sizeof(Value));
    good_ = good_ && static_cast<uint64_t>(value) == field->value;
  }
  void operator()(const char* name, char (&text)[24]) {
    const Vector::Field* field = Next(name, 24);
    good_ = good_ && std::memcmp(text, field->text, 24) == 0;
  }
};

// CRCs as division of a long polynomial, bit by bit of the message: not the code under test's way.
uint32_t Divide(const uint8_t* data, size_t size, int width, uint32_t polynomial, bool reflected) {
  uint64_t remainder = 0;
  const uint64_t top = uint64_t{1} << width;
  for (size_t bit = 0; bit < size * 8 + static_cast<size_t>(width); ++bit) {
    const size_t byte = bit / 8;
    const size_t place = reflected ? bit % 8 : 7 - bit % 8;
    uint64_t next = byte < size ? data[byte] >> place & 1 : 0;
    if (bit < static_cast<size_t>(width)) next ^= 1;  // starts with ones
    remainder = remainder << 1 | next;
    if (remainder & top) remainder ^= top | polynomial;
  }
  return static_cast<uint32_t>(remainder);
}
uint32_t OtherCrc16(const uint8_t* data, size_t size) {
  return Divide(data, size, 16, 0x1021, false);
}
uint32_t OtherCrc32(const uint8_t* data, size_t size) {
  const uint32_t forward = ~Divide(data, size, 32, 0x04C11DB7, true);
  uint32_t result = 0;
  for (int bit = 0; bit < 32; ++bit) result |= (forward >> bit & 1) << (31 - bit);
  return result;
}

// Frame -> payload without its check, by walking from zero to zero. 0: damaged.
size_t OtherUnframe(const uint8_t* frame, size_t size, uint8_t* payload) {
  if (size < 2 || frame[size - 1] != 0) return 0;
  size_t written = 0;
  size_t zero_at = frame[0];
  for (size_t i = 1; i + 1 < size; ++i) {
    const bool is_zero = i == zero_at;
    if (is_zero) zero_at += frame[i];
    payload[written++] = is_zero ? 0 : frame[i];
  }
  if (zero_at != size - 1 || written < 7) return 0;
  if (OtherCrc16(payload, written - 2) !=
      static_cast<uint32_t>(payload[written - 2] << 8 | payload[written - 1])) {
    return 0;
  }
  written -= 6;
  uint32_t sent = 0;
  for (int i = 3; i >= 0; --i) sent = sent << 8 | payload[written + static_cast<size_t>(i)];
  return sent == OtherCrc32(payload, written) ? written : 0;
}

template <typename Message>
const char* Check(const Vector& vector, Type type) {
  // The vector by other means: type and fields are in it as they were given.
  uint8_t plain[192];
  const size_t plain_size = OtherUnframe(vector.frame, vector.frame_size, plain);
  if (plain_size == 0) return "the frame is damaged";
  if (plain[0] != static_cast<uint8_t>(type)) return "the type differs";
  size_t at = 1;
  for (int i = 0; i < vector.field_count; ++i) {
    const Vector::Field& field = vector.fields[i];
    for (int j = 0; j < field.width_bytes; ++j) {
      const uint8_t byte = field.width_bytes == 24 ? static_cast<uint8_t>(field.text[j])
                                                   : static_cast<uint8_t>(field.value >> (8 * j) & 0xFF);
      if (at >= plain_size || plain[at++] != byte) return "a field differs from the bytes";
    }
  }
  if (at != plain_size) return "the frame has bytes of no field";

  // Fields -> frame.
  Message message;
  Filler filler(vector);
  Fields(message, filler);
  if (!filler.good()) return "the fields are not those of the message";
  uint8_t payload[kMaxPayload];
  uint8_t frame[kMaxFrame];
  const size_t size = EncodeFrame(payload, Encode(message, payload), frame);
  if (size != vector.frame_size || std::memcmp(frame, vector.frame, size) != 0)
    return "Encode gives other bytes";

  // Frame -> fields.
  FrameParser parser;
  for (size_t i = 0; i < vector.frame_size; ++i) {
    if (parser.Push(vector.frame[i]) != (i + 1 == vector.frame_size)) return "the parser finds no frame";
  }
  Message decoded;
  if (!Decode(parser.payload(), parser.size(), &decoded)) return "Decode refuses it";
  Comparer comparer(vector);
  Fields(decoded, comparer);
  return comparer.good() ? nullptr : "Decode gives other values";
}

int HexDigit(char letter) {
  if (letter >= '0' && letter <= '9') return letter - '0';
  return letter >= 'a' && letter <= 'f' ? letter - 'a' + 10 : -1;
}

// Up to one of `ends`; false if it does not fit.
bool TakeWord(const char** text, const char* ends, char* out, size_t room) {
  size_t size = 0;
  while (**text != 0 && std::strchr(ends, **text) == nullptr) {
    if (size + 1 >= room) return false;
    out[size++] = *(*text)++;
  }
  return size > 0;
}

// name:width=value
bool TakeField(const char** text, Vector::Field* field) {
  char width[8] = {};
  if (!TakeWord(text, ":=\n", field->name, sizeof(field->name)) || *(*text)++ != ':') return false;
  if (!TakeWord(text, "=\n", width, sizeof(width)) || *(*text)++ != '=') return false;
  if (std::strcmp(width, "text24") == 0) {
    field->width_bytes = 24;
    return TakeWord(text, " \n", field->text, sizeof(field->text));
  }
  char value[24] = {};
  if (width[0] != 'u' || !TakeWord(text, " \n", value, sizeof(value))) return false;
  field->width_bytes = std::atoi(width + 1) / 8;
  field->value = std::strtoull(value, nullptr, 0);
  return true;
}

}  // namespace

bool NextVector(const char** text, Vector* vector) {
  *vector = Vector{};
  while (**text == '#' || **text == '\n') {
    while (**text != 0 && **text != '\n') ++*text;
    if (**text == '\n') ++*text;
  }
  if (**text == 0) return false;

  bool good = TakeWord(text, " \n", vector->name, sizeof(vector->name));
  while (good && **text == ' ') {
    ++*text;
    good = vector->field_count < static_cast<int>(sizeof(vector->fields) / sizeof(vector->fields[0])) &&
           TakeField(text, &vector->fields[vector->field_count++]);
  }
  good = good && **text == '\n';
  while (**text != 0 && *(*text)++ != '\n') {
  }
  while (**text != 0 && **text != '\n') {
    const int high = HexDigit((*text)[0]);
    const int low = high < 0 ? -1 : HexDigit((*text)[1]);
    if (low < 0 || vector->frame_size == sizeof(vector->frame)) {
      good = false;
      break;
    }
    vector->frame[vector->frame_size++] = static_cast<uint8_t>(high << 4 | low);
    *text += 2;
    if (**text == ' ') ++*text;
  }
  while (**text != 0 && *(*text)++ != '\n') {
  }
  if (!good) vector->frame_size = 0;
  return true;
}

const char* CheckVector(const Vector& vector) {
#define TOUCHSTONE_FIRMWARE_CASE(Name) \
  if (std::strcmp(vector.name, #Name) == 0) return Check<Name>(vector, Type::k##Name)
  TOUCHSTONE_FIRMWARE_CASE(Hello);
  TOUCHSTONE_FIRMWARE_CASE(HelloReply);
  TOUCHSTONE_FIRMWARE_CASE(Configure);
  TOUCHSTONE_FIRMWARE_CASE(Configured);
  TOUCHSTONE_FIRMWARE_CASE(Arm);
  TOUCHSTONE_FIRMWARE_CASE(Armed);
  TOUCHSTONE_FIRMWARE_CASE(Disarm);
  TOUCHSTONE_FIRMWARE_CASE(Disarmed);
  TOUCHSTONE_FIRMWARE_CASE(Clock);
  TOUCHSTONE_FIRMWARE_CASE(ClockReply);
  TOUCHSTONE_FIRMWARE_CASE(Event);
  TOUCHSTONE_FIRMWARE_CASE(Acknowledge);
  TOUCHSTONE_FIRMWARE_CASE(Recall);
  TOUCHSTONE_FIRMWARE_CASE(Recalled);
  TOUCHSTONE_FIRMWARE_CASE(StatusRequest);
  TOUCHSTONE_FIRMWARE_CASE(Status);
  TOUCHSTONE_FIRMWARE_CASE(Refused);
#undef TOUCHSTONE_FIRMWARE_CASE
  return "no message of this name";
}

}  // namespace touchstone::firmware
