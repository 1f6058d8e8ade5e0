#include "server/base/text/wrapped_text.h"

#include <gtest/gtest.h>

#include <cstdlib>

namespace touchstone {
namespace {

TEST(TerminalWidth, IsWhatColumnsSaysWithinBounds) {
  const char* const before = std::getenv("COLUMNS");
  const std::string kept = before == nullptr ? "" : before;
  for (const auto& [columns, width] : {std::pair{"80", 80}, std::pair{"20", 60}, std::pair{"1000", 160}}) {
    ::setenv("COLUMNS", columns, 1);
    EXPECT_EQ(TerminalWidth(), width);
    EXPECT_EQ(TextWidth(), static_cast<size_t>(std::min(width, 110)));
  }
  if (before == nullptr)
    ::unsetenv("COLUMNS");
  else
    ::setenv("COLUMNS", kept.c_str(), 1);
}

TEST(Wrap, BreaksBetweenWordsAndIndentsWhatFollows) {
  EXPECT_EQ(Wrap("one two three", 9, 2), "one two\n  three");
  EXPECT_EQ(Wrap("one  two", 80, 0), "one two");
  EXPECT_EQ(Wrap("a,bb,ccc", 6, 2), "a,\n  bb,\n  ccc");
}

}  // namespace
}  // namespace touchstone
