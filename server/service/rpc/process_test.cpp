#include "server/service/rpc/process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <algorithm>

namespace touchstone::service {
namespace {

// What `log` writes to stderr with the log of a server.
std::string Logged(bool json, void (*log)()) {
  const auto before = spdlog::default_logger();
  testing::internal::CaptureStderr();
  SetUpLog("info", json);
  log();
  spdlog::default_logger()->flush();
  const std::string text = testing::internal::GetCapturedStderr();
  spdlog::drop("touchstone");
  spdlog::set_default_logger(before);
  return text;
}

TEST(Log, WhatAClientSentStaysWithinItsLine) {
  for (const bool json : {false, true}) {
    const std::string text = Logged(json, [] {
      spdlog::info("session '{}' stored", "eve\n2026-11-24 10:00:00.000 info ana released the stop\x1b[2J");
    });
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
    EXPECT_EQ(text.find('\x1b'), std::string::npos) << text;
    EXPECT_THAT(text, testing::HasSubstr("released the stop"));
  }
}

TEST(Log, ALineIsNotLongerThanPeopleRead) {
  const std::string text = Logged(false, [] { spdlog::info("{}", std::string(1 << 20, 'x')); });
  EXPECT_LT(text.size(), 9000u);
  EXPECT_GT(text.size(), 8000u);
}

}  // namespace
}  // namespace touchstone::service
