// Options that are keys of a TOML file and flags of a command at once.
#pragma once

#include <set>
#include <string>
#include <variant>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/service/options/limits.h"

namespace CLI {
class App;
}

namespace touchstone::service {

// One option. A key "arm.address" stands in the file's table [arm]; its flag is --arm-address.
struct Option {
  using Target =
      std::variant<std::string*, int*, double*, bool*, std::vector<std::string>*, std::vector<double>*>;
  std::string key;
  std::string meaning;
  Target target;
  std::string former_key = {};  // an older name, which files and flags may still use; empty: none
};

// An option for every row of the table of limits.
void AppendLimits(Limits* limits, std::vector<Option>* options);

// "--arm-address".
std::string FlagOf(const Option& option);

// Reads the keys of a TOML text into the targets, but those in `set` (which flags gave: those win). Errors
// name `origin`, the line, the key, and what would be right; an unknown key is one.
absl::Status ReadToml(const std::string& text, const std::string& origin, const std::vector<Option>& options,
                      const std::set<std::string>& set);

// Adds a flag for every option.
void AddFlags(const std::vector<Option>& options, CLI::App* app);
// The keys whose flags were given.
std::set<std::string> GivenKeys(const std::vector<Option>& options, const CLI::App& app);
// What is wrong with the first word that no flag took; suggests a near one.
absl::Status UnknownFlag(const std::vector<Option>& options, const CLI::App& app);

// The command line of a server, read into the options' targets, and the file that its --config names.
struct CommandLine {
  bool done = false;            // help or version was printed
  std::string config;           // empty: none was named
  std::set<std::string> given;  // keys whose flags were given: those win
};
// `help` is the text above the flags; `config_help` that of --config.
absl::StatusOr<CommandLine> ReadCommandLine(const std::string& program, const std::string& help,
                                            const std::string& config_help,
                                            const std::vector<Option>& options, int argc,
                                            const char* const* argv);

// "trace" to "off".
absl::Status CheckLogLevel(const std::string& level);

// "must be from 1 to 9".
absl::Status CheckRange(double value, double lower, double upper, const std::string& name);

}  // namespace touchstone::service
