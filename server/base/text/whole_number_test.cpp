#include "server/base/text/whole_number.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace touchstone {
namespace {

using ::testing::HasSubstr;

TEST(WholeNumber, IsReadAsPeopleWriteIt) {
  const std::pair<const char*, uint64_t> cases[] = {{"0", 0},           {"1000", 1000},
                                                    {"010", 10},        {"1_000_000", 1'000'000},
                                                    {"1e6", 1'000'000}, {"1E+6", 1'000'000},
                                                    {"2.5e3", 2500},    {"2.50e1", 25},
                                                    {"3.0", 3},         {"18446744073709551615", UINT64_MAX}};
  for (const auto& [text, value] : cases) {
    const absl::StatusOr<uint64_t> read = ParseWholeNumber(text);
    ASSERT_TRUE(read.ok()) << text << ": " << read.status();
    EXPECT_EQ(*read, value) << text;
  }
}

TEST(WholeNumber, IsNothingElse) {
  for (const char* text : {"", "-1", "+1", "ten", "2.5", "2.55e1", ".5e1", "1e-3", "1e", "e3", "1__0", "_1",
                           "1_", "1_e3", "0x10", "1 000", "1,000", "1e3.5", "1.2.3e5"})
    EXPECT_THAT(std::string(ParseWholeNumber(text).status().message()),
                HasSubstr("is no whole number from 0 on"))
        << text;
}

TEST(WholeNumber, IsNotLargerThanItsType) {
  for (const char* text : {"18446744073709551616", "1e20", "2e19", "1e999999999999"})
    EXPECT_THAT(std::string(ParseWholeNumber(text).status().message()), HasSubstr("is too large")) << text;
}

}  // namespace
}  // namespace touchstone
