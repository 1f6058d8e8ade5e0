// touchstone demo: what it makes, what it refuses, and that nothing of it goes on when it ends.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"
#include "server/base/test_tier.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class DemoCommandTest : public RealBinaryTest {
 protected:
  // Waits until a file of the test's folder has this text.
  void AwaitText(const std::string& name, const std::string& text) {
    const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(120);
    while (!fs::exists(Path(name)) || Read(name).find(text) == std::string::npos) {
      ASSERT_LT(std::chrono::steady_clock::now(), give_up) << name << " has no '" << text << "'";
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }

  // Running programs that were started in the test's folder.
  int ProgramsInFolder() {
    int count = 0;
    std::error_code error;
    for (const auto& process : fs::directory_iterator("/proc"))
      count += fs::read_symlink(process.path() / "cwd", error) == fs::path(Path("")).parent_path();
    return count;
  }
};

TEST_F(DemoCommandTest, HiddenEffectIsFoundAndShown) {
  TOUCHSTONE_SECOND_TIER("long: 192 touches of an emulated rig");
  const Outcome outcome = Run({"demo", "--objects", "lat20", "--json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const nlohmann::json made = nlohmann::json::parse(outcome.out);
  EXPECT_THAT(Read(made["report"]), HasSubstr("tip_radius"));
  EXPECT_THAT(Read(made["better_model"]), HasSubstr("tip_radius"));
  EXPECT_THAT(Read(made["log"]),
              AllOf(HasSubstr("MISSING_EFFECTS: The model lacks tip_radius"), HasSubstr("tip_radius added")));
  EXPECT_THAT(Read("touchstone-demo/rig/gateway.log"), HasSubstr("stopped"));
}

TEST_F(DemoCommandTest, InterruptionEndsEveryProgram) {
  const pid_t demo = Start({"demo", "--objects", "lat20"});
  AwaitText(".err", "touches, about");
  EXPECT_EQ(ProgramsInFolder(), 4) << "the demo, its rig, the gateway and touchstone rig run";
  ::kill(demo, SIGTERM);
  EXPECT_EQ(Wait(demo).exit_code, 130);
  EXPECT_THAT(Read("touchstone-demo/rig/gateway.log"), HasSubstr("stopped"));
  EXPECT_EQ(ProgramsInFolder(), 0);
}

TEST_F(DemoCommandTest, WhatIsThereStays) {
  fs::create_directory(Path("mine"));
  Write("mine/report.html", "mine");
  EXPECT_THAT(Run({"demo", "-o", "mine"}).err, HasSubstr("mine/report.html exists already"));
  EXPECT_EQ(Read("mine/report.html"), "mine");
  // Not even --force takes a folder that no demo made.
  fs::create_directory(Path("mine/rig"));
  Write("mine/rig/gateway.toml", "mine");
  EXPECT_THAT(Run({"demo", "-o", "mine", "--force"}).err,
              HasSubstr("mine/rig exists already and is no demo's"));
  EXPECT_EQ(Read("mine/rig/gateway.toml"), "mine");
}

TEST_F(DemoCommandTest, ProgramThatIsMissingIsNamed) {
  // The program alone in another folder.
  const fs::path program = fs::read_symlink("/proc/self/exe").parent_path() / "touchstone";
  fs::copy_file(program, Path("touchstone"));
  const std::string command =
      "cd '" + Path("") + "' && ./touchstone demo > out 2> err; echo $? >> err; ./touchstone doctor > doctor";
  ASSERT_EQ(std::system(command.c_str()), 0);
  EXPECT_THAT(Read("err"),
              AllOf(HasSubstr("/touchstone-rig-emulator is needed and is not there"), HasSubstr("\n2\n")));
  EXPECT_THAT(Read("doctor"),
              HasSubstr("!!  Programs   touchstone-server, touchstone-gateway, touchstone-rig-emulator"));
}

}  // namespace
}  // namespace touchstone::cli
