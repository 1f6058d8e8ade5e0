#include "server/session/journal/command_bytes.h"

#include <gtest/gtest.h>

namespace touchstone::session {
namespace {

v1::CommandedTouch Command() {
  touch::CommandedTouch touch;
  touch.target_m = {0.01, -0.02, 0.03};
  touch.session_time_s = 7;
  touch.covariates = {{"cov_humidity", 40}, {"cov_temperature", 21}};
  return CommandMessage(touch);
}

TEST(CommandBytes, AJournalsCommandHasNoSessionTimeAndNoLimitThatIsNone) {
  touch::CommandedTouch touch;
  touch.session_time_s = 7;
  const auto command = ParseCommandBytes(CommandBytes(touch));
  ASSERT_TRUE(command.has_value());
  EXPECT_FALSE(command->has_session_time_s());
  EXPECT_FALSE(command->has_stroke_m());
  EXPECT_EQ(command->speed_m_s(), touch.speed_m_s);
}

TEST(CommandBytes, CommandsWithinANanometreAreTheSame) {
  v1::CommandedTouch other = Command();
  other.mutable_target_m()->set_x(other.target_m().x() + 9e-10);
  EXPECT_TRUE(SameCommand(CommandBytes(Command()), CommandBytes(other)));
  other.mutable_target_m()->set_x(other.target_m().x() + 9e-10);
  EXPECT_FALSE(SameCommand(CommandBytes(Command()), CommandBytes(other)));
}

TEST(CommandBytes, TimeAndCovariatesAreOfTheCommandButNotOfItsPath) {
  v1::CommandedTouch later = Command(), warmer = Command(), bare = Command(), limited = Command();
  later.set_session_time_s(8);
  (*warmer.mutable_covariates())["cov_temperature"] = 22;
  bare.clear_covariates();
  limited.set_stroke_m(0.1);
  for (const v1::CommandedTouch& other : {later, warmer, bare}) {
    EXPECT_TRUE(SamePath(Command(), other));
    EXPECT_FALSE(SameCommand(CommandBytes(Command()), CommandBytes(other)));
  }
  EXPECT_FALSE(SamePath(Command(), limited));
}

TEST(CommandBytes, WhatIsNoCommandIsTheSameOnlyAsBytes) {
  EXPECT_TRUE(SameCommand("not a command", "not a command"));
  EXPECT_FALSE(SameCommand("not a command", "nor this"));
  // A field of a later version: number 99, a varint.
  const std::string bytes = CommandBytes(Command());
  const std::string one = bytes + std::string("\x98\x06\x01", 3),
                    two = bytes + std::string("\x98\x06\x02", 3);
  ASSERT_TRUE(ParseCommandBytes(one).has_value());
  EXPECT_TRUE(SameCommand(one, one));
  EXPECT_FALSE(SameCommand(one, two));
  EXPECT_FALSE(SameCommand(one, bytes));
}

}  // namespace
}  // namespace touchstone::session
