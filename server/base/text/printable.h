// Text of others, made fit for a line of a log, for a message, a terminal or a page: the one place that says which characters
// may stand there.
#pragma once

#include <string>

#include <absl/strings/string_view.h>

namespace touchstone {

// Whether it is UTF-8 without control characters, invisible ones, and those that turn the direction of what follows
// (U+202E; Unicode's categories Cc, Cf, Zl and Zp), so that it stays one line of what a log or a terminal shows, and reads as it
// is.
bool IsPrintableLine(absl::string_view text);

// `text` with such characters and what is no UTF-8 as \xHH, cut after about `max_bytes` with "..." to say so. With
// `keep_lines` line ends stay.
std::string Printable(absl::string_view text, size_t max_bytes, bool keep_lines = false);

// JSON that says the same, with such characters in its texts as \uHHHH.
std::string EscapeInJson(absl::string_view json);

}  // namespace touchstone
