// What the controller sends on its primary and secondary interfaces (30001, 30002): only what helps to say
// why a program did not start, and the arm's calibrated kinematics.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "server/gateway/arm/kinematics/kinematics.h"

namespace touchstone::gateway::arm {

// What is used of one package; the rest of it is skipped.
struct PrimaryUpdate {
  // "PROGRAM_XXX_STARTED" with the program's name, an error or a runtime exception with its place, in words.
  std::string message;
  bool is_error = false;         // of any kind
  bool is_exception = false;     // of a program: it does not compile, or failed
  std::string started, stopped;  // name of the program that did
  std::optional<DhTable> kinematics;
};

// Cuts the stream into packages and parses them. What is malformed is DATA_LOSS; the stream is lost then.
class PrimaryStream {
 public:
  void Append(absl::string_view bytes) { bytes_.append(bytes.data(), bytes.size()); }
  absl::StatusOr<std::optional<PrimaryUpdate>> Next();

 private:
  std::string bytes_;
};

}  // namespace touchstone::gateway::arm
