// A page in the person's browser.
#pragma once

#include <string>

#include "client/cli/common.h"

namespace touchstone::cli {

// Opens a file or an address with xdg-open; says so on stderr where there is none.
void OpenInBrowser(const Cli& cli, const std::string& page);

}  // namespace touchstone::cli
