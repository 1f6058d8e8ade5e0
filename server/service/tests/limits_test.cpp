// The table of limits: configuration, description and documentation say the same.
#include "server/service/options/limits.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <set>

#include "server/base/test_paths.h"
#include "server/base/text/over_limit.h"
#include "server/base/text/text.h"
#include "server/service/rpc/server.h"
#include "server/service/rpc/server_flags.h"
#include "touchstone/v1/source.grpc.pb.h"

namespace touchstone::service {
namespace {

using testing::HasSubstr;

// A value that is allowed and not the default.
double OtherValue(const LimitRow& row) {
  const double value = row.Value(Limits());
  return value + 1 <= row.upper ? value + 1 : value - 1;
}

std::string FlagOfRow(const LimitRow& row) {
  return absl::StrCat("--", absl::StrReplaceAll(row.name, {{"_", "-"}}));
}

TEST(Limits, HaveNamesOfTheirOwnAndDefaultsWithinTheirRanges) {
  std::set<std::string> names;
  for (const LimitRow& row : LimitTable()) EXPECT_TRUE(names.insert(row.name).second) << row.name;
  EXPECT_EQ(names.size(), LimitTable().size());
  EXPECT_TRUE(CheckLimits(Limits()).ok()) << CheckLimits(Limits());
  EXPECT_GE(names.size(), 40u);
}

TEST(Limits, AreFlagsAndKeysOfTheFile) {
  std::vector<std::string> words = {"touchstone-server"};
  std::string toml;
  for (const LimitRow& row : LimitTable()) {
    words.push_back(absl::StrCat(FlagOfRow(row), "=", LimitInWords(OtherValue(row))));
    absl::StrAppend(&toml, row.name, " = ", LimitInWords(OtherValue(row)), "\n");
  }
  std::vector<const char*> argv;
  for (const std::string& word : words) argv.push_back(word.c_str());
  const auto by_flags = ParseServerFlags(static_cast<int>(argv.size()), argv.data());
  ASSERT_TRUE(by_flags.ok()) << by_flags.status();
  ServerFlags by_file;
  ASSERT_TRUE(ApplyToml(toml, "server.toml", &by_file).ok());
  for (const LimitRow& row : LimitTable()) {
    EXPECT_EQ(row.Value(by_flags->options), OtherValue(row)) << row.name;
    EXPECT_EQ(row.Value(by_file.options), OtherValue(row)) << row.name;
  }
}

TEST(Limits, AreCheckedByTheirRanges) {
  for (const LimitRow& row : LimitTable()) {
    Limits limits;
    std::visit([&](auto member) { limits.*member = static_cast<std::decay_t<decltype(limits.*member)>>(-1); },
               row.field);
    EXPECT_THAT(std::string(CheckLimits(limits).message()), HasSubstr(row.name));
  }
}

TEST(Limits, AreDescribedAsTheyAreConfigured) {
  ServerOptions options;
  options.listen = "";
  options.supershape_triangles = 200;
  options.max_streams = 77;
  options.stall_s = 12.5;
  const auto server = Server::Start(options);
  ASSERT_TRUE(server.ok()) << server.status();
  grpc::ClientContext context;
  v1::DescribeResponse description;
  ASSERT_TRUE(v1::Source::NewStub((*server)->InProcessChannel())->Describe(&context, {}, &description).ok());
  ASSERT_EQ(description.limits_size(), static_cast<int>(LimitTable().size()));
  for (int k = 0; k < description.limits_size(); ++k) {
    const LimitRow& row = LimitTable()[k];
    EXPECT_EQ(description.limits(k).name(), row.name);
    EXPECT_EQ(description.limits(k).value(), row.Value(options)) << row.name;
    EXPECT_EQ(description.limits(k).unit(), row.unit);
    EXPECT_EQ(description.limits(k).meaning(), row.meaning);
  }
}

TEST(Limits, StandInTheDocumentationWithTheirDefaults) {
  const auto page = ReadFile(SourceDir() + "/server/LIMITS.md");
  ASSERT_TRUE(page.ok()) << page.status();
  std::string table;
  for (const LimitRow& row : LimitTable())
    absl::StrAppend(&table, "| `", row.name, "` | ", row.ValueInWords(Limits()), " | ", row.meaning, " |\n");
  EXPECT_THAT(*page, HasSubstr(table)) << "the page should hold this table:\n" << table;
}

}  // namespace
}  // namespace touchstone::service
