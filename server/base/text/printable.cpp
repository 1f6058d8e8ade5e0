#include "server/base/text/printable.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cstdint>
#include <iterator>

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

uint32_t CodePointOf(absl::string_view character) {
  const auto first = static_cast<uint8_t>(character[0]);
  uint32_t code = character.size() == 1 ? first : first & (0x7f >> character.size());
  for (const char c : character.substr(1)) code = code << 6 | (static_cast<uint8_t>(c) & 0x3f);
  return code;
}

// Unicode 15.0, UnicodeData.txt: Cc (terminals obey those beyond U+007F too), Cf, Zl and Zp, in their order.
constexpr struct {
  uint32_t first, last;
} kUnprintable[] = {{0x0, 0x1f},        {0x7f, 0x9f},       {0xad, 0xad},       {0x600, 0x605},
                    {0x61c, 0x61c},     {0x6dd, 0x6dd},     {0x70f, 0x70f},     {0x890, 0x891},
                    {0x8e2, 0x8e2},     {0x180e, 0x180e},   {0x200b, 0x200f},   {0x2028, 0x202e},
                    {0x2060, 0x206f},   {0xfeff, 0xfeff},   {0xfff9, 0xfffb},   {0x110bd, 0x110bd},
                    {0x110cd, 0x110cd}, {0x13430, 0x1343f}, {0x1bca0, 0x1bca3}, {0x1d173, 0x1d17a},
                    {0xe0000, 0xe007f}};

bool IsUnprintable(absl::string_view character) {
  const uint32_t code = CodePointOf(character);
  if (code >= 0x20 && code < 0x7f) return false;
  return std::any_of(std::begin(kUnprintable), std::end(kUnprintable),
                     [code](const auto& range) { return code >= range.first && code <= range.last; });
}

}  // namespace

bool IsPrintableLine(absl::string_view text) {
  while (!text.empty()) {
    const size_t bytes = CharacterBytes(text);
    if (bytes == 0 || IsUnprintable(text.substr(0, bytes))) return false;
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
    else if (bytes == 0 || IsUnprintable(character))
      for (const char each : character)
        absl::StrAppend(&line, "\\x", absl::Hex(static_cast<uint8_t>(each), absl::kZeroPad2));
    else
      absl::StrAppend(&line, character);
    text.remove_prefix(character.size());
  }
  return line;
}

std::string EscapeInJson(absl::string_view json) {
  std::string escaped;
  while (!json.empty()) {
    const size_t bytes = std::max<size_t>(CharacterBytes(json), 1);
    const absl::string_view character = json.substr(0, bytes);
    // Outside of its texts JSON has no others than spaces and line ends, inside none below U+0020.
    if (bytes == 1 || !IsUnprintable(character)) {
      absl::StrAppend(&escaped, character);
    } else if (const uint32_t code = CodePointOf(character); code < 0x10000) {
      absl::StrAppend(&escaped, "\\u", absl::Hex(code, absl::kZeroPad4));
    } else {
      absl::StrAppend(&escaped, "\\u", absl::Hex(0xd7c0 + (code >> 10)), "\\u",
                      absl::Hex(0xdc00 + (code & 0x3ff)));
    }
    json.remove_prefix(bytes);
  }
  return escaped;
}

}  // namespace touchstone
