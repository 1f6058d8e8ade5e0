// How wide the terminal is that a command prints to.
#pragma once

#include <cstddef>

namespace touchstone::cli {

// Columns of standard output, from 60 to 160; 110 where it is no terminal.
int TerminalWidth();

// The same for text, whose lines are at most 110 columns.
size_t TextWidth();

}  // namespace touchstone::cli
