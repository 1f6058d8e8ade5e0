#include "server/gateway/audit/audit_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "server/base/test_folder.h"
#include "server/base/text/text.h"

namespace touchstone::gateway::audit {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;

class AuditLogTest : public ::testing::Test {
 protected:
  AuditLogTest() { path_ = folder_ + "/audit.jsonl"; }

  std::vector<std::string> Lines() const {
    std::ifstream file(path_);
    std::vector<std::string> lines;
    for (std::string line; std::getline(file, line);) lines.push_back(line);
    return lines;
  }

  const TestFolder test_folder_;
  const std::string& folder_ = test_folder_.path();
  std::string path_;
};

TEST_F(AuditLogTest, EveryEventIsOneJsonObjectALine) {
  auto log = AuditLog::Open(path_);
  ASSERT_TRUE(log.ok()) << log.status();
  ASSERT_TRUE((*log)->Write("stop", {{"holder", "lab \"two\"\nline"}, {"why", "bad \xff byte"}}).ok());
  ASSERT_TRUE((*log)->Write("touch", {}).ok());
  const std::vector<std::string> lines = Lines();
  ASSERT_EQ(lines.size(), 2u);
  const auto first = nlohmann::json::parse(lines[0]);
  EXPECT_EQ(first["event"], "stop");
  EXPECT_EQ(first["holder"], "lab \"two\"\nline");
  EXPECT_THAT(
      first["time"].get<std::string>(),
      MatchesRegex("20[0-9][0-9]-[01][0-9]-[0-3][0-9]T[0-2][0-9]:[0-5][0-9]:[0-6][0-9].[0-9][0-9][0-9]Z"));
  EXPECT_THAT(lines[0], HasSubstr("{\"time\":"));
}

TEST_F(AuditLogTest, NoLineHasCharactersThatCannotBeSeen) {
  auto log = AuditLog::Open(path_);
  ASSERT_TRUE(log.ok()) << log.status();
  ASSERT_TRUE((*log)->Write("stop", {{"why", "left \u202ethgir J\u00fcrgen"}}).ok());
  EXPECT_THAT(Lines()[0], HasSubstr("left \\u202ethgir J\u00fcrgen"));
  EXPECT_EQ(nlohmann::json::parse(Lines()[0])["why"], "left \u202ethgir J\u00fcrgen");
}

TEST_F(AuditLogTest, LinesNameWhoHoldsTheLeaseUnlessTheyNameAHolder) {
  auto log = AuditLog::Open(path_);
  ASSERT_TRUE(log.ok()) << log.status();
  std::string holder = "ana@lab rig-run 4711";
  (*log)->NameHolders([&] { return holder; });
  ASSERT_TRUE((*log)->Write("touch_failed", {{"id", "t1"}}).ok());
  ASSERT_TRUE((*log)->Write("lease_acquired", {{"holder", "ben@lab"}}).ok());
  holder = "";
  ASSERT_TRUE((*log)->Write("latched", {}).ok());
  const std::vector<std::string> lines = Lines();
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(nlohmann::json::parse(lines[0])["lease_holder"], "ana@lab rig-run 4711");
  EXPECT_FALSE(nlohmann::json::parse(lines[1]).contains("lease_holder"));
  EXPECT_FALSE(nlohmann::json::parse(lines[2]).contains("lease_holder"));
}

TEST_F(AuditLogTest, LinesAreAppendedToWhatIsThere) {
  for (const char* event : {"first", "second"}) {
    auto log = AuditLog::Open(path_);
    ASSERT_TRUE(log.ok()) << log.status();
    ASSERT_TRUE((*log)->Write(event, {}).ok());
  }
  const std::vector<std::string> lines = Lines();
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_THAT(lines[0], HasSubstr("first"));
  EXPECT_THAT(lines[1], HasSubstr("second"));
}

TEST_F(AuditLogTest, ALineThatWasCutOffIsKeptAndEnded) {
  std::ofstream(path_) << "{\"time\": \"2026-01-31T12:00";
  auto log = AuditLog::Open(path_);
  ASSERT_TRUE(log.ok()) << log.status();
  ASSERT_TRUE((*log)->Write("stop", {}).ok());
  const std::vector<std::string> lines = Lines();
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0], "{\"time\": \"2026-01-31T12:00");
  EXPECT_EQ(nlohmann::json::parse(lines[1])["event"], "stop");
}

TEST_F(AuditLogTest, LinesOfManyThreadsStayWhole) {
  auto log = AuditLog::Open(path_);
  ASSERT_TRUE(log.ok()) << log.status();
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < 25; ++i) EXPECT_TRUE((*log)->Write("e", {{"n", std::to_string(t * 25 + i)}}).ok());
    });
  for (std::thread& thread : threads) thread.join();
  std::set<std::string> seen;
  for (const std::string& line : Lines()) seen.insert(nlohmann::json::parse(line)["n"].get<std::string>());
  EXPECT_EQ(seen.size(), 100u);
}

TEST_F(AuditLogTest, WithoutAPathNothingIsKept) {
  auto log = AuditLog::Open("");
  ASSERT_TRUE(log.ok()) << log.status();
  EXPECT_TRUE((*log)->Write("stop", {}).ok());
}

TEST_F(AuditLogTest, ErrorsNameTheFile) {
  EXPECT_THAT(std::string(AuditLog::Open(folder_ + "/no/audit.jsonl").status().message()),
              HasSubstr(folder_ + "/no/audit.jsonl: cannot be opened"));
  EXPECT_FALSE(AuditLog::Open(folder_).ok());
  auto full = AuditLog::Open("/dev/full");
  EXPECT_THAT(std::string(full.status().message()), HasSubstr("is no regular file"));
}

}  // namespace
}  // namespace touchstone::gateway::audit
