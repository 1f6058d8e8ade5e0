// A script that makes a shell complete the command line.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace touchstone::cli {

// For bash; with `zsh` after what lets zsh read it (bashcompinit). Completes commands, options, and files elsewhere.
std::string CompletionScript(const CLI::App& root, bool zsh);

}  // namespace touchstone::cli
