// Commands whose work is done in Python: this program becomes the interpreter, so that terminal, signals and exit code are
// the module's.
#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

namespace touchstone::cli {

struct PythonCommand {
  const char* name;         // touchstone NAME
  const char* description;  // its first sentence stands in the list of commands
  const char* module;       // with a main that touchstone.command.run calls
  const char* first_words;  // what the module is given before what was typed; may be empty
  const char* package;      // that pip installs it by
  const char* options;  // for completion, with blanks between them; the module's parser is what knows them
};

// One row per command.
const std::vector<PythonCommand>& PythonCommands();

// The interpreter: TOUCHSTONE_PYTHON, which the commands of the wheel set to their own, else python3 in PATH. NOT_FOUND
// if there is none.
absl::StatusOr<std::string> FindPython();

// Returns only if no interpreter can be started. A Python without the module ends with kRefused and says how to install it.
absl::Status BecomePythonCommand(const PythonCommand& command, const std::vector<std::string>& arguments);

}  // namespace touchstone::cli
