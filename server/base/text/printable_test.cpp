#include "server/base/text/printable.h"

#include <gtest/gtest.h>

namespace touchstone {
namespace {

TEST(Printable, AnotherPersonsTextStaysOneLine) {
  EXPECT_EQ(Printable("cable freed\n2026-11-24 warn stop from ana", 1000),
            "cable freed\\x0a2026-11-24 warn stop from ana");
  EXPECT_EQ(Printable("\x1b[2Jgone\r", 1000), "\\x1b[2Jgone\\x0d");
  EXPECT_EQ(Printable("two\nlines\t", 1000, /*keep_lines=*/true), "two\nlines\\x09");
  EXPECT_FALSE(IsPrintableLine("a\nb"));
  EXPECT_FALSE(IsPrintableLine(std::string(1, '\0')));
}

TEST(Printable, LettersOfAllLanguagesStay) {
  for (const char* text : {"", "ana@bench2", "Jürgen löst das Kabel", "触れる", "🤖"}) {
    EXPECT_TRUE(IsPrintableLine(text)) << text;
    EXPECT_EQ(Printable(text, 1000), text);
  }
}

TEST(Printable, WhatIsNoUtf8IsShownAsBytes) {
  for (const char* text :
       {"\xff", "\xc3", "\xc0\xaf", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\xc2\x85", "a\x80"})
    EXPECT_FALSE(IsPrintableLine(text)) << text;
  EXPECT_EQ(Printable("\xffz", 1000), "\\xffz");
  EXPECT_EQ(Printable("\xc2\x9b"
                      "2J",
                      1000),
            "\\xc2\\x9b2J");
}

TEST(Printable, NothingIsInvisibleOrTurnsTheDirectionOfWhatFollows) {
  // Left-to-right and right-to-left overrides and isolates, zero width, soft hyphen, line and paragraph separators, tags.
  for (const char* text : {"\u202e", "\u202d", "\u2066", "\u200b", "\u200f", "\u00ad", "\u2028", "\u2029",
                           "\ufeff", "\u061c", "\u0085", "\U000e0041"}) {
    EXPECT_FALSE(IsPrintableLine(std::string("a") + text)) << text;
    EXPECT_EQ(Printable(text, 1000, /*keep_lines=*/true).substr(0, 2), "\\x");
  }
  EXPECT_EQ(Printable("a\u202eb", 1000), "a\\xe2\\x80\\xaeb");
}

TEST(EscapeInJson, SaysTheSameVisibly) {
  EXPECT_EQ(EscapeInJson("{\n  \"name\": \"J\u00fcrgen \u202egpj\U000e0041\"\n}"),
            "{\n  \"name\": \"J\u00fcrgen \\u202egpj\\udb40\\udc41\"\n}");
}

TEST(Printable, CutsBetweenCharactersAndSaysSo) {
  EXPECT_EQ(Printable("abcdef", 3), "abc...");
  EXPECT_EQ(Printable("abc", 3), "abc");
  EXPECT_EQ(Printable("aéé", 2), "aé...");
  EXPECT_LT(Printable(std::string(1 << 20, '\n'), 256).size(), 270u);
}

}  // namespace
}  // namespace touchstone
