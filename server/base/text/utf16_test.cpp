#include "server/base/text/utf16.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace touchstone {
namespace {

using ::testing::HasSubstr;

std::string Utf16(const std::u16string& text, bool big_endian, bool mark) {
  std::string bytes;
  for (const char16_t unit : (mark ? u"\xFEFF" : u"") + text) {
    const char high = static_cast<char>(unit >> 8), low = static_cast<char>(unit & 0xFF);
    bytes += big_endian ? high : low;
    bytes += big_endian ? low : high;
  }
  return bytes;
}

TEST(Utf16, IsReadInBothByteOrdersWithAndWithoutAMark) {
  const std::u16string text = u"touch,object\n1,thé \u2212 \U0001F600\n";
  for (const bool big_endian : {false, true})
    for (const bool mark : {false, true}) {
      const std::string bytes = Utf16(text, big_endian, mark);
      EXPECT_TRUE(IsUtf16(bytes));
      const auto read = Utf8FromUtf16(bytes);
      ASSERT_TRUE(read.ok()) << read.status();
      EXPECT_EQ(*read, "touch,object\n1,th\xC3\xA9 \xE2\x88\x92 \xF0\x9F\x98\x80\n");
    }
}

TEST(Utf16, IsNotSeenInUtf8NorInNumbers) {
  for (const char* text : {"", "t", "touch,object", "\xEF\xBB\xBFtouch", "thé"}) EXPECT_FALSE(IsUtf16(text));
  EXPECT_FALSE(IsUtf16(std::string(80, '\0')));
}

TEST(Utf16, ThatIsCutIsRefusedWithItsLine) {
  const auto message = [](const std::string& bytes) {
    return std::string(Utf8FromUtf16(bytes).status().message());
  };
  const std::string bytes = Utf16(u"a\nbc", false, true);
  EXPECT_THAT(message(bytes.substr(0, bytes.size() - 1)),
              HasSubstr("line 2: the file ends within a character"));
  EXPECT_THAT(message(Utf16(u"a\xD83D", false, true)), HasSubstr("line 1: the first half"));
  EXPECT_THAT(message(Utf16(u"a\xDE00z", true, true)), HasSubstr("line 1: the second half"));
}

}  // namespace
}  // namespace touchstone
