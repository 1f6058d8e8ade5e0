// Text for people on a terminal: how wide that is, and lines of that width.
#pragma once

#include <cstddef>
#include <string>

#include <absl/strings/string_view.h>

namespace touchstone {

// Columns of standard output, or what COLUMNS says, from 60 to 160; 110 where neither is known.
int TerminalWidth();

// The same for text, whose lines are at most 110 columns.
size_t TextWidth();

// Text broken into lines of at most `width` columns, all but the first indented. Words stay whole, but for one that a line has
// no room for.
std::string Wrap(absl::string_view text, size_t width, size_t indent);

}  // namespace touchstone
