// Manual pages out of the tables that --help prints: there is no second description of a command.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace touchstone::service {

// The page of a program or a command in roff (man(7)), section 1. `words`: how it is called, "touchstone", "rig", "run". Other pages
// are named in `see_also`: "touchstone-server".
std::string ManPage(const CLI::App& app, const std::vector<std::string>& words,
                    const std::vector<std::string>& see_also);

// Prints the page of a program of one command where "--man" is all that it was called with, as the build does.
bool PrintedManPage(const CLI::App& app, int argc, const char* const* argv);

}  // namespace touchstone::service
