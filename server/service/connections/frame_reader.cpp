#include "server/service/connections/frame_reader.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

namespace touchstone::service {
namespace {

constexpr uint32_t kStreamBits = 0x7fffffff;  // the first bit is reserved

uint32_t BigEndian(absl::string_view bytes) {
  uint32_t number = 0;
  for (const char byte : bytes) number = number << 8 | static_cast<uint8_t>(byte);
  return number;
}

FrameHead HeadOf(absl::string_view bytes) {
  return {BigEndian(bytes.substr(0, 3)), static_cast<FrameType>(bytes[3]), static_cast<uint8_t>(bytes[4]),
          BigEndian(bytes.substr(5, 4)) & kStreamBits};
}

}  // namespace

std::string BigEndianOf(uint32_t number, int bytes) {
  std::string text;
  for (int k = bytes - 1; k >= 0; --k) text.push_back(static_cast<char>(number >> 8 * k));
  return text;
}

size_t FrameReader::Pass(absl::string_view bytes, Admit admit) {
  size_t at = 0;
  for (;;) {
    const size_t payload = std::min(payload_left_, bytes.size() - at);
    at += payload;
    payload_left_ -= payload;
    if (payload_left_ > 0 || bytes.size() - at < FrameHead::kBytes) return at;
    const FrameHead head = HeadOf(bytes.substr(at, FrameHead::kBytes));
    if (!admit(head, bytes.substr(at + FrameHead::kBytes, head.length))) return at;
    at += FrameHead::kBytes;
    payload_left_ = head.length;
  }
}

std::string FrameOf(const FrameHead& head, absl::string_view payload) {
  return absl::StrCat(BigEndianOf(static_cast<uint32_t>(payload.size()), 3),
                      std::string{static_cast<char>(head.type), static_cast<char>(head.flags)},
                      BigEndianOf(head.stream, 4), payload);
}

}  // namespace touchstone::service
