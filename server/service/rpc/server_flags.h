// Command line and TOML file of touchstone-server. Every key of the file is a flag too; unknown ones are
// errors.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "server/service/options/server_options.h"

namespace touchstone::service {

struct ServerFlags {
  ServerOptions options;
  std::string log_level = "info";
  bool log_json = false;
  bool done = false;  // help or version was printed
};

absl::StatusOr<ServerFlags> ParseServerFlags(int argc, const char* const* argv);

// Reads the keys of a TOML text into the options that flags did not set; `origin` stands in errors.
absl::Status ApplyToml(const std::string& text, const std::string& origin, ServerFlags* flags);

}  // namespace touchstone::service
