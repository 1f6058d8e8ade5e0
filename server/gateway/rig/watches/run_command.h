// Runs a program and waits for it.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <absl/status/status.h>

namespace touchstone::gateway {

// The program (found in PATH) with its arguments; stdin is empty, what it prints goes to stderr. Errors tell
// how it ended. `guard` is asked before it begins and all the time; if it fails, or after timeout_s, the program is
// killed with all that it has started.
absl::Status RunCommand(const std::vector<std::string>& arguments, double timeout_s,
                        const std::function<absl::Status()>& guard);

}  // namespace touchstone::gateway
