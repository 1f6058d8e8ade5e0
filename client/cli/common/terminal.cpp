#include "client/cli/common/terminal.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

namespace touchstone::cli {

constexpr int kWidthOfNoTerminal = 110;
constexpr int kMinWidth = 60, kMaxWidth = 160;
constexpr int kMaxTextWidth = 110;

int TerminalWidth() {
  winsize size{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return kWidthOfNoTerminal;
  return std::clamp<int>(size.ws_col, kMinWidth, kMaxWidth);
}

size_t TextWidth() {
  return static_cast<size_t>(std::min(TerminalWidth(), kMaxTextWidth));
}

bool OnTerminal() {
  return ::isatty(STDOUT_FILENO) != 0;
}

bool ColourOnStdout() {
  return OnTerminal() && std::getenv("NO_COLOR") == nullptr;
}

}  // namespace touchstone::cli
