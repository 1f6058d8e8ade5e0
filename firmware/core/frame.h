// Frames on the serial line (PROTOCOL.md): COBS(payload | CRC-16 of it, big endian) | 0x00. Nothing but
// frames is on the line; whatever is between two zeros and is no frame is garbage, counted and skipped.
#pragma once

#include <cstddef>
#include <cstdint>

namespace touchstone::firmware {

constexpr size_t kMaxPayload = 128;
constexpr size_t kMaxFrame = kMaxPayload + 2 + 2 + 1;  // CRC, COBS overhead, delimiter

// CRC-16/CCITT-FALSE: polynomial 0x1021, start 0xFFFF; "123456789" gives 0x29B1.
uint16_t Crc16(const uint8_t* data, size_t size);

// Writes the whole frame, delimiter included; returns its size, 0 if the payload is empty or too long. `out`
// has room for kMaxFrame bytes.
size_t EncodeFrame(const uint8_t* payload, size_t size, uint8_t* out);

// Takes the bytes of the line one at a time.
class FrameParser {
 public:
  // True if this byte ended a good frame; payload() and size() then hold until the next call.
  bool Push(uint8_t byte);
  const uint8_t* payload() const { return buffer_; }
  size_t size() const { return size_; }
  // Pieces between delimiters that were no frame: wrong CRC, wrong COBS, too long. Empty pieces do not count.
  uint32_t bad_frames() const { return bad_frames_; }

 private:
  uint8_t buffer_[kMaxFrame];
  size_t received_ = 0;
  size_t size_ = 0;
  bool too_long_ = false;
  uint32_t bad_frames_ = 0;
};

}  // namespace touchstone::firmware
