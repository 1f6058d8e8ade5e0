#include "server/service/options/server_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <map>

#include "server/service/options/option_table.h"
#include "server/service/rpc/server_flags.h"

namespace touchstone::service {
namespace {

using testing::HasSubstr;

TEST(MeshSpec, ReadsNameFileAndWhatTheFileDoesNotSay) {
  const auto source = ParseMeshSpec("cup=models/cup.off,fit_mm=150,up=y");
  ASSERT_TRUE(source.ok());
  EXPECT_EQ(source->name, "cup");
  EXPECT_EQ(source->path, "models/cup.off");
  EXPECT_EQ(source->fit_mm, 150);
  EXPECT_EQ(source->up, "y");
}

TEST(MeshSpec, RefusesMistakesWithAHint) {
  EXPECT_THAT(std::string(ParseMeshSpec("cup.off").status().message()), HasSubstr("NAME=FILE"));
  EXPECT_THAT(std::string(ParseMeshSpec("cup=cup.off,fit=3").status().message()),
              HasSubstr("did you mean 'fit_mm'"));
  EXPECT_THAT(std::string(ParseMeshSpec("cup=cup.off,scale=-1").status().message()), HasSubstr("above 0"));
  EXPECT_THAT(std::string(ParseMeshSpec("c/up=cup.off").status().message()), HasSubstr("letters, digits"));
}

TEST(ServerFlags, FlagsWinOverTheFile) {
  const std::string path = testing::TempDir() + "/server.toml";
  std::ofstream(path)
      << "listen = \"127.0.0.1:7\"\nthreads = 3\nrenderer = \"cpu\"\nmesh = [\"a=a.off\", \"b=b.off\"]\n";
  const char* arguments[] = {"touchstone-server", "--config", path.c_str(), "--threads", "5"};
  const auto flags = ParseServerFlags(5, arguments);
  ASSERT_TRUE(flags.ok()) << flags.status();
  EXPECT_EQ(flags->options.listen, "127.0.0.1:7");
  EXPECT_EQ(flags->options.threads, 5);
  EXPECT_EQ(flags->options.renderer.kind, image::RendererKind::kCpu);
  EXPECT_EQ(flags->options.meshes.size(), 2u);
}

TEST(ServerFlags, EveryMistakeNamesItsPlace) {
  ServerFlags flags;
  EXPECT_THAT(std::string(ApplyToml("\nthread = 3\n", "server.toml", &flags).message()),
              testing::AllOf(HasSubstr("server.toml:2"), HasSubstr("did you mean 'threads'")));
  EXPECT_THAT(std::string(ApplyToml("threads = \"two\"\n", "server.toml", &flags).message()),
              HasSubstr("whole number"));
  EXPECT_THAT(std::string(ApplyToml("threads = \n", "server.toml", &flags).message()),
              HasSubstr("server.toml:1"));
  EXPECT_THAT(std::string(ApplyToml("renderer = \"gpu\"\n", "server.toml", &flags).message()),
              HasSubstr("cpu"));
  const char* arguments[] = {"touchstone-server", "--treads", "3"};
  EXPECT_THAT(std::string(ParseServerFlags(3, arguments).status().message()),
              HasSubstr("did you mean '--threads'"));
}

TEST(ServerFlags, CountsAreReadAsPeopleWriteThem) {
  for (const char* text : {"1000000", "1_000_000", "1e6", "1E+6", "0.1e7", "0001000000"}) {
    const char* arguments[] = {"touchstone-server", "--max-session-touches", text};
    const auto flags = ParseServerFlags(3, arguments);
    ASSERT_TRUE(flags.ok()) << text << ": " << flags.status();
    EXPECT_EQ(flags->options.max_session_touches, 1'000'000) << text;
  }
  for (const char* text : {"1000000", "1_000_000", "1e6", "1E+6", "0.1e7"}) {
    ServerFlags flags;
    const absl::Status read = ApplyToml(absl::StrCat("max_session_touches = ", text), "server.toml", &flags);
    ASSERT_TRUE(read.ok()) << text << ": " << read;
    EXPECT_EQ(flags.options.max_session_touches, 1'000'000) << text;
  }
  const char* any_device[] = {"touchstone-server", "--egl-device", "-1"};
  EXPECT_EQ(ParseServerFlags(3, any_device)->options.renderer.egl_device, -1);
}

TEST(ServerFlags, WhatIsNoCountIsRefusedAsItWasSent) {
  for (const auto& [text, complaint] :
       std::map<const char*, const char*>{{"1.5", "'1.5' is no whole number"},
                                          {"-ten", "'-ten' is no whole number"},
                                          {"0x10", "'0x10' is no whole"},
                                          {"1e10", "'1e10' is out of range"},
                                          {"-1e99", "'-1e99' is out of range"}}) {
    const char* arguments[] = {"touchstone-server", "--max-session-touches", text};
    EXPECT_THAT(std::string(ParseServerFlags(3, arguments).status().message()),
                testing::AllOf(HasSubstr("--max-session-touches"), HasSubstr(complaint)));
  }
  ServerFlags flags;
  EXPECT_THAT(std::string(ApplyToml("threads = 1.5\n", "server.toml", &flags).message()),
              HasSubstr("whole number"));
  for (const char* text : {"1e10", "-1e300", "nan", "inf", "9223372036854775807"})
    EXPECT_THAT(std::string(ApplyToml(absl::StrCat("threads = ", text), "server.toml", &flags).message()),
                HasSubstr("whole number"))
        << text;
}

// What the parser's library took for granted.
TEST(OptionTable, ATableWhoseNameIsMissingIsRefusedWithItsPlace) {
  EXPECT_THAT(std::string(ReadToml(" [\n", "a.toml", {}, {}).message()), HasSubstr("a.toml:1:3"));
}

TEST(OptionTable, ALetterWhereNoneMayStandIsRefusedWithItsPlace) {
  int threads = 1;
  const std::vector<Option> options = {{"threads", "", &threads}};
  for (const char* letter : {"\u00FC", "\u2E90", "\uFEF7"})
    EXPECT_THAT(
        std::string(ReadToml(absl::StrCat("threads = 3", letter, " 3\n"), "a.toml", options, {}).message()),
        HasSubstr("a.toml:1:"));
}

TEST(OptionTable, AFormerKeyIsStillRead) {
  for (const char* name : {"uri", "source"}) {
    std::string uri;
    const std::vector<Option> options = {{"camera.uri", "", &uri, "camera.source"}};
    const absl::Status read =
        ReadToml("[camera]\n" + std::string(name) + " = \"folder:pictures\"\n", "a.toml", options, {});
    ASSERT_TRUE(read.ok()) << read;
    EXPECT_EQ(uri, "folder:pictures");
  }
}

TEST(OptionTable, AFlagWinsOverItsFormerKeyInAFile) {
  std::string uri = "0";
  const std::vector<Option> options = {{"camera.uri", "", &uri, "camera.source"}};
  ASSERT_TRUE(ReadToml("[camera]\nsource = \"1\"\n", "a.toml", options, {"camera.uri"}).ok());
  EXPECT_EQ(uri, "0");
}

}  // namespace
}  // namespace touchstone::service
