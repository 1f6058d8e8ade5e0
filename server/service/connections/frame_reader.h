// The heads of HTTP/2 frames (RFC 9113, 4.1) in the bytes of one direction of a connection.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include <absl/functional/function_ref.h>
#include <absl/strings/string_view.h>

namespace touchstone::service {

enum class FrameType : uint8_t {
  kData = 0,
  kHeaders = 1,
  kRstStream = 3,
  kSettings = 4,
  kGoAway = 7,
  kWindowUpdate = 8,
  kContinuation = 9,
};

inline constexpr uint8_t kEndStream = 1, kEndHeaders = 4;  // flags of a frame
// What a client begins with (RFC 9113, 3.4).
inline constexpr absl::string_view kClientPreface = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

struct FrameHead {
  static constexpr size_t kBytes = 9;

  uint32_t length = 0;  // of the payload, in bytes
  FrameType type = FrameType::kData;
  uint8_t flags = 0;
  uint32_t stream = 0;

  bool Has(uint8_t flag) const { return (flags & flag) != 0; }
};

class FrameReader {
 public:
  // `bytes_before`: how many come before the first frame.
  explicit FrameReader(size_t bytes_before = 0) : payload_left_(bytes_before) {}

  // Whether a frame may pass, by its head and as much of its payload as has come.
  using Admit = absl::FunctionRef<bool(const FrameHead& head, absl::string_view payload)>;
  // How many of the bytes, which follow those that passed before, may pass: those of frames that are admitted, until one is
  // not. A head passes as a whole.
  size_t Pass(absl::string_view bytes, Admit admit);

  // Whether what passed ends with a frame.
  bool between_frames() const { return payload_left_ == 0; }

 private:
  size_t payload_left_;
};

std::string BigEndianOf(uint32_t number, int bytes);
// A frame's bytes; the length is that of the payload.
std::string FrameOf(const FrameHead& head, absl::string_view payload);

}  // namespace touchstone::service
