#include "server/base/text/value_text.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <map>

#include "server/base/test_paths.h"

namespace touchstone {
namespace {

// What a rule makes of its arguments.
std::string Written(const std::string& rule, const std::vector<double>& arguments) {
  if (rule == "value_with_error") return ValueWithError(arguments.at(0), arguments.at(1));
  if (rule == "rounded") return RoundedNumber(arguments.at(0), static_cast<int>(arguments.at(1)));
  if (rule == "fixed") return FixedNumber(arguments.at(0), static_cast<int>(arguments.at(1)));
  if (rule == "round") return RoundNumber(arguments.at(0));
  return absl::StrCat("no rule ", rule);
}

// The page's test reads the same file.
TEST(ValueText, WritesEveryCaseOfTheTableThatThePageReadsToo) {
  std::ifstream file(SourceDir() + "/server/base/text/value_text_cases.txt");
  std::map<std::string, int> cases;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    const std::vector<std::string> parts = absl::StrSplit(line, " | ");
    ASSERT_EQ(parts.size(), 3u) << line;
    std::vector<double> arguments;
    for (const absl::string_view text : absl::StrSplit(parts[1], ' '))
      arguments.push_back(std::strtod(std::string(text).c_str(), nullptr));
    EXPECT_EQ(Written(parts[0], arguments), parts[2]) << line;
    ++cases[parts[0]];
  }
  EXPECT_EQ(cases.size(), 4u) << "every rule has cases";
}

}  // namespace
}  // namespace touchstone
