#include "client/cli/browser.h"

#include <spawn.h>
#include <unistd.h>

namespace touchstone::cli {

void OpenInBrowser(const Cli& cli, const std::string& page) {
  std::string program = "xdg-open", address = page;
  char* const arguments[] = {program.data(), address.data(), nullptr};
  pid_t child = 0;
  if (::posix_spawnp(&child, program.c_str(), nullptr, nullptr, arguments, environ) != 0)
    cli.Log(absl::StrCat("--open: there is no xdg-open here; open ", page, " in a browser"));
}

}  // namespace touchstone::cli
