// A script that makes a shell complete the command line.
#pragma once

#include <string>

#include "client/cli/common/common.h"

namespace touchstone::cli {

// For bash; with `zsh` after what lets zsh read it (bashcompinit). Completes commands, options, and files elsewhere.
std::string CompletionScript(const Cli& cli, bool zsh);
// The same for fish, with what each command and option is for.
std::string FishCompletion(const Cli& cli);

}  // namespace touchstone::cli
