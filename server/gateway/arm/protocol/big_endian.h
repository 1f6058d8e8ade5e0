// Numbers as the controller's protocols pack them: big-endian, without padding. A reader that is asked for
// more than there is returns zeros and remembers it, so that a message is checked once, at its end.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>

#include <absl/strings/string_view.h>

namespace touchstone::gateway::arm {

class BigEndianReader {
 public:
  explicit BigEndianReader(absl::string_view bytes) : bytes_(bytes) {}

  uint8_t U8() { return static_cast<uint8_t>(Unsigned(1)); }
  uint16_t U16() { return static_cast<uint16_t>(Unsigned(2)); }
  uint32_t U32() { return static_cast<uint32_t>(Unsigned(4)); }
  uint64_t U64() { return Unsigned(8); }
  int32_t I32() { return static_cast<int32_t>(U32()); }
  double F64() {
    const uint64_t bits = U64();
    double value;
    std::memcpy(&value, &bits, sizeof(value));
    return value;
  }
  absl::string_view Bytes(size_t count) {
    if (count > bytes_.size()) {
      ok_ = false;
      count = 0;
    }
    const absl::string_view piece = bytes_.substr(0, count);
    bytes_.remove_prefix(count);
    return piece;
  }
  absl::string_view Rest() { return Bytes(bytes_.size()); }

  bool ok() const { return ok_; }  // nothing was read that is not there
  bool AtEnd() const { return bytes_.empty(); }

 private:
  uint64_t Unsigned(size_t count) {
    if (count > bytes_.size()) {
      ok_ = false;
      bytes_ = {};
      return 0;
    }
    uint64_t value = 0;
    for (size_t i = 0; i < count; ++i) value = value << 8 | static_cast<uint8_t>(bytes_[i]);
    bytes_.remove_prefix(count);
    return value;
  }

  absl::string_view bytes_;
  bool ok_ = true;
};

class BigEndianWriter {
 public:
  BigEndianWriter& U8(uint8_t value) { return Unsigned(value, 1); }
  BigEndianWriter& U16(uint16_t value) { return Unsigned(value, 2); }
  BigEndianWriter& U32(uint32_t value) { return Unsigned(value, 4); }
  BigEndianWriter& U64(uint64_t value) { return Unsigned(value, 8); }
  BigEndianWriter& I32(int32_t value) { return U32(static_cast<uint32_t>(value)); }
  BigEndianWriter& F64(double value) {
    uint64_t bits;
    std::memcpy(&bits, &value, sizeof(bits));
    return U64(bits);
  }
  BigEndianWriter& Bytes(absl::string_view bytes) {
    bytes_.append(bytes.data(), bytes.size());
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  BigEndianWriter& Unsigned(uint64_t value, int count) {
    for (int i = count - 1; i >= 0; --i) bytes_.push_back(static_cast<char>(value >> (8 * i) & 0xff));
    return *this;
  }

  std::string bytes_;
};

}  // namespace touchstone::gateway::arm
