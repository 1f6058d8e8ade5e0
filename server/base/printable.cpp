#include "server/base/printable.h"

#include <absl/strings/str_cat.h>

#include <cstdint>

namespace touchstone {
namespace {

// Bytes of the UTF-8 character at the beginning of `text`; 0 if there is none. RFC 3629, section 4.
size_t CharacterBytes(absl::string_view text) {
  const auto byte = [&](size_t k) { return static_cast<uint8_t>(text[k]); };
  const uint8_t first = byte(0);
  if (first < 0x80) return 1;
  const size_t bytes = first >= 0xc2 && first <= 0xdf   ? 2
                       : (first & 0xf0) == 0xe0         ? 3
                       : first >= 0xf0 && first <= 0xf4 ? 4
                                                        : 0;
  if (bytes == 0 || text.size() < bytes) return 0;
  for (size_t k = 1; k < bytes; ++k)
    if ((byte(k) & 0xc0) != 0x80) return 0;
  // Longer than need be, halves of UTF-16 pairs, beyond U+10FFFF.
  const bool wrong = (first == 0xe0 && byte(1) < 0xa0) || (first == 0xed && byte(1) > 0x9f) ||
                     (first == 0xf0 && byte(1) < 0x90) || (first == 0xf4 && byte(1) > 0x8f);
  return wrong ? 0 : bytes;
}

// U+0000 to U+001F, U+007F, and U+0080 to U+009F, which terminals obey too.
bool IsControl(absl::string_view character) {
  const auto first = static_cast<uint8_t>(character[0]);
  return first < 0x20 || first == 0x7f || (first == 0xc2 && static_cast<uint8_t>(character[1]) < 0xa0);
}

}  // namespace

bool IsPrintableLine(absl::string_view text) {
  while (!text.empty()) {
    const size_t bytes = CharacterBytes(text);
    if (bytes == 0 || IsControl(text.substr(0, bytes))) return false;
    text.remove_prefix(bytes);
  }
  return true;
}

std::string Printable(absl::string_view text, size_t max_bytes, bool keep_lines) {
  std::string line;
  while (!text.empty()) {
    if (line.size() >= max_bytes) return absl::StrCat(line, "...");
    const size_t bytes = CharacterBytes(text);
    const absl::string_view character = text.substr(0, bytes == 0 ? 1 : bytes);
    if (keep_lines && character == "\n")
      line += '\n';
    else if (bytes == 0 || IsControl(character))
      for (const char each : character)
        absl::StrAppend(&line, "\\x", absl::Hex(static_cast<uint8_t>(each), absl::kZeroPad2));
    else
      absl::StrAppend(&line, character);
    text.remove_prefix(character.size());
  }
  return line;
}

}  // namespace touchstone
