// Every reader of bytes that others wrote, as a function that a fuzzer can call.
#pragma once

#include <string>
#include <vector>

#include <absl/strings/string_view.h>

namespace touchstone::fuzz {

enum class Answer {
  kRefused,   // with an error that says what is wrong
  kAccepted,  // and what was read holds together
  kWrong      // accepted, but what it writes of it reads back as something else, or an error without words
};

struct Parser {
  std::string name;  // also of its archive, corpus/NAME.tar.xz
  Answer (*read)(absl::string_view bytes);
};

// In the order of their names' first letters' subject: meshes, tables, models, a rig's files, a rig's wire.
const std::vector<Parser>& Parsers();

}  // namespace touchstone::fuzz
