#include "server/base/text/utf16.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <cstdint>

namespace touchstone {
namespace {

constexpr absl::string_view kLittleEndianMark("\xFF\xFE", 2);
constexpr absl::string_view kBigEndianMark("\xFE\xFF", 2);

// Whether the first four characters are ASCII with a 0 as byte `zero` (0 or 1) of each.
bool BeginsWithAscii(absl::string_view bytes, size_t zero) {
  if (bytes.size() < 8) return false;
  for (size_t at = 0; at < 8; at += 2)
    if (bytes[at + zero] != 0 || !absl::ascii_isprint(bytes[at + 1 - zero])) return false;
  return true;
}

void AppendUtf8(uint32_t code, std::string* text) {
  if (code < 0x80) {
    *text += static_cast<char>(code);
    return;
  }
  const int more = code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
  constexpr uint32_t kLead[] = {0, 0xC0, 0xE0, 0xF0};
  *text += static_cast<char>(kLead[more] | code >> (6 * more));
  for (int k = more - 1; k >= 0; --k) *text += static_cast<char>(0x80 | ((code >> (6 * k)) & 0x3F));
}

}  // namespace

bool IsUtf16(absl::string_view bytes) {
  return absl::StartsWith(bytes, kLittleEndianMark) || absl::StartsWith(bytes, kBigEndianMark) ||
         BeginsWithAscii(bytes, 0) || BeginsWithAscii(bytes, 1);
}

absl::StatusOr<std::string> Utf8FromUtf16(absl::string_view bytes) {
  const bool big_endian = absl::StartsWith(bytes, kBigEndianMark) || BeginsWithAscii(bytes, 0);
  if (absl::StartsWith(bytes, kLittleEndianMark) || absl::StartsWith(bytes, kBigEndianMark))
    bytes.remove_prefix(2);
  std::string text;
  text.reserve(bytes.size() / 2);
  int line = 1;
  const auto half = [&line](absl::string_view what) {
    return absl::InvalidArgumentError(
        absl::StrCat("line ", line, ": ", what, "; whole characters of UTF-16 were expected (or UTF-8)"));
  };
  const auto unit = [&](size_t at) -> uint32_t {
    const auto first = static_cast<unsigned char>(bytes[at]),
               second = static_cast<unsigned char>(bytes[at + 1]);
    return big_endian ? first << 8 | second : second << 8 | first;
  };
  for (size_t at = 0; at + 1 < bytes.size(); at += 2) {
    uint32_t code = unit(at);
    if (code >= 0xDC00 && code < 0xE000) return half("the second half of a character stands alone");
    if (code >= 0xD800 && code < 0xDC00) {
      const uint32_t low = at + 3 < bytes.size() ? unit(at + 2) : 0;
      if (low < 0xDC00 || low >= 0xE000) return half("the first half of a character stands alone");
      code = 0x10000 + ((code - 0xD800) << 10) + (low - 0xDC00);
      at += 2;
    }
    line += code == '\n';
    AppendUtf8(code, &text);
  }
  if (bytes.size() % 2 != 0) return half("the file ends within a character");
  return text;
}

}  // namespace touchstone
