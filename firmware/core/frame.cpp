#include "firmware/core/frame.h"

namespace touchstone::firmware {
namespace {

// COBS without its delimiter; `out` has room for size + 1 bytes. Up to 253 bytes need one byte more.
static_assert(kMaxPayload + 2 <= 253, "a run of 254 bytes without a zero would need a second code byte");
size_t EncodeCobs(const uint8_t* data, size_t size, uint8_t* out) {
  size_t code_at = 0;
  size_t written = 1;
  for (size_t i = 0; i < size; ++i) {
    if (data[i] != 0) {
      out[written++] = data[i];
      continue;
    }
    out[code_at] = static_cast<uint8_t>(written - code_at);
    code_at = written++;
  }
  out[code_at] = static_cast<uint8_t>(written - code_at);
  return written;
}

// In place; returns the number of bytes, 0 if a code points beyond the end. There is no zero among the bytes.
size_t DecodeCobs(uint8_t* bytes, size_t size) {
  size_t read = 0;
  size_t written = 0;
  while (read < size) {
    const size_t next = read + bytes[read];
    if (next > size) return 0;
    ++read;
    while (read < next) bytes[written++] = bytes[read++];
    if (read < size) bytes[written++] = 0;
  }
  return written;
}

}  // namespace

uint16_t Crc16(const uint8_t* data, size_t size) {
  uint32_t crc = 0xFFFF;
  for (size_t i = 0; i < size; ++i) {
    crc ^= static_cast<uint32_t>(data[i]) << 8;
    for (int bit = 0; bit < 8; ++bit) crc = (crc << 1) ^ (crc & 0x8000 ? 0x1021 : 0);
    crc &= 0xFFFF;
  }
  return static_cast<uint16_t>(crc);
}

size_t EncodeFrame(const uint8_t* payload, size_t size, uint8_t* out) {
  if (size == 0 || size > kMaxPayload) return 0;
  uint8_t data[kMaxPayload + 2];
  for (size_t i = 0; i < size; ++i) data[i] = payload[i];
  const uint16_t crc = Crc16(payload, size);
  data[size] = static_cast<uint8_t>(crc >> 8);
  data[size + 1] = static_cast<uint8_t>(crc & 0xFF);
  const size_t written = EncodeCobs(data, size + 2, out);
  out[written] = 0;
  return written + 1;
}

bool FrameParser::Push(uint8_t byte) {
  if (byte != 0) {
    if (received_ < sizeof(buffer_)) {
      buffer_[received_++] = byte;
    } else {
      too_long_ = true;
    }
    return false;
  }

  // The end of a piece: nothing, a frame, or garbage.
  const size_t received = received_;
  const bool too_long = too_long_;
  received_ = 0;
  too_long_ = false;
  size_ = 0;
  if (received == 0) return false;
  const size_t size = too_long ? 0 : DecodeCobs(buffer_, received);
  if (size >= 3 && size <= kMaxPayload + 2 &&
      Crc16(buffer_, size - 2) == static_cast<uint16_t>(buffer_[size - 2] << 8 | buffer_[size - 1])) {
    size_ = size - 2;
    return true;
  }
  ++bad_frames_;
  return false;
}

}  // namespace touchstone::firmware
