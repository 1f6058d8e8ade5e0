// Text of others, made fit for a line of a log or for a message.
#pragma once

#include <string>

#include <absl/strings/string_view.h>

namespace touchstone {

// Whether it is UTF-8 without control characters, so that it stays one line of what a log or a terminal shows.
bool IsPrintableLine(absl::string_view text);

// `text` with control characters and what is no UTF-8 as \xHH, cut after about `max_bytes` with "..." to say so. With
// `keep_lines` line ends stay.
std::string Printable(absl::string_view text, size_t max_bytes, bool keep_lines = false);

}  // namespace touchstone
