#include "client/cli/common/terminal.h"

#include <unistd.h>

#include <cstdlib>

namespace touchstone::cli {

bool OnTerminal() {
  return ::isatty(STDOUT_FILENO) != 0;
}

bool ColourOnStdout() {
  return OnTerminal() && std::getenv("NO_COLOR") == nullptr;
}

}  // namespace touchstone::cli
