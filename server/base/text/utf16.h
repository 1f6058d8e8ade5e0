// UTF-16 as text editors and spreadsheets write it ("Unicode"), read as UTF-8.
#pragma once

#include <string>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

namespace touchstone {

// Whether bytes are text in UTF-16: they begin with a byte-order mark, or with an ASCII letter, digit or '#' one byte of
// which is 0, four times in a row.
bool IsUtf16(absl::string_view bytes);

// Such bytes as UTF-8, without a mark. INVALID_ARGUMENT with the line where half a character stands.
absl::StatusOr<std::string> Utf8FromUtf16(absl::string_view bytes);

}  // namespace touchstone
