// touchstone-fuzz: libFuzzer on one reader, which TOUCHSTONE_PARSER names (parsers.cpp lists them). tests/fuzz/run builds
// and calls it; clang only.
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/parsers.h"

namespace {

const touchstone::fuzz::Parser& Chosen() {
  const char* name = std::getenv("TOUCHSTONE_PARSER");
  for (const touchstone::fuzz::Parser& parser : touchstone::fuzz::Parsers())
    if (name != nullptr && parser.name == name) return parser;
  std::fprintf(stderr, "touchstone-fuzz: TOUCHSTONE_PARSER is '%s'; one of these would be right:\n",
               name == nullptr ? "" : name);
  for (const touchstone::fuzz::Parser& parser : touchstone::fuzz::Parsers())
    std::fprintf(stderr, "  %s\n", parser.name.c_str());
  std::exit(2);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const touchstone::fuzz::Parser& parser = Chosen();
  const auto answer = parser.read(absl::string_view(reinterpret_cast<const char*>(data), size));
  if (answer == touchstone::fuzz::Answer::kWrong) std::abort();
  return 0;
}
