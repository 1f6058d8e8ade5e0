// Big-endian numbers in byte strings.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>

namespace touchstone::rig {

class WireWriter {
 public:
  template <typename Number>
  WireWriter& Put(Number number) {
    static_assert(std::is_arithmetic_v<Number>);
    using Bits =
        std::conditional_t<sizeof(Number) == 8, uint64_t,
                           std::conditional_t<sizeof(Number) == 4, uint32_t,
                                              std::conditional_t<sizeof(Number) == 2, uint16_t, uint8_t>>>;
    Bits bits;
    std::memcpy(&bits, &number, sizeof bits);
    for (int shift = 8 * (static_cast<int>(sizeof bits) - 1); shift >= 0; shift -= 8)
      bytes.push_back(static_cast<char>(static_cast<uint64_t>(bits) >> shift & 0xFF));
    return *this;
  }
  WireWriter& Text(std::string_view text) {
    bytes.append(text);
    return *this;
  }
  template <typename Vector>
  WireWriter& PutAll(const Vector& numbers) {
    for (int i = 0; i < static_cast<int>(numbers.size()); ++i) Put(numbers[i]);
    return *this;
  }
  std::string bytes;
};

// Reads what is there; `ok` turns false for good where bytes are missing, and zeros come then.
class WireReader {
 public:
  explicit WireReader(std::string_view bytes) : left(bytes) {}
  template <typename Number>
  Number Get() {
    Number number{};
    if (left.size() < sizeof(Number)) {
      ok = false;
      left = {};
      return number;
    }
    uint64_t bits = 0;
    for (size_t i = 0; i < sizeof(Number); ++i) bits = bits << 8 | static_cast<unsigned char>(left[i]);
    left.remove_prefix(sizeof(Number));
    if constexpr (sizeof(Number) == 8) {
      std::memcpy(&number, &bits, 8);
    } else if constexpr (sizeof(Number) == 4) {
      const auto narrow = static_cast<uint32_t>(bits);
      std::memcpy(&number, &narrow, 4);
    } else if constexpr (sizeof(Number) == 2) {
      number = static_cast<Number>(static_cast<uint16_t>(bits));
    } else {
      number = static_cast<Number>(static_cast<uint8_t>(bits));
    }
    return number;
  }
  std::string_view left;
  bool ok = true;
};

}  // namespace touchstone::rig
