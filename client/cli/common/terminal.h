// The terminal that a command prints to: its width, its colours.
#pragma once

#include <cstddef>

namespace touchstone::cli {

// Columns of standard output, from 60 to 160; 110 where it is no terminal.
int TerminalWidth();

// The same for text, whose lines are at most 110 columns.
size_t TextWidth();

// Whether standard output is a terminal.
bool OnTerminal();

// Whether standard output is a terminal that takes colours (NO_COLOR is not set).
bool ColourOnStdout();

}  // namespace touchstone::cli
