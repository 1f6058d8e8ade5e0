// The terminal that a command prints to: its width (server/base/text/wrapped_text.h), its colours.
#pragma once

#include "server/base/text/wrapped_text.h"

namespace touchstone::cli {

// Whether standard output is a terminal.
bool OnTerminal();

// Whether standard output is a terminal that takes colours (NO_COLOR is not set).
bool ColourOnStdout();

}  // namespace touchstone::cli
