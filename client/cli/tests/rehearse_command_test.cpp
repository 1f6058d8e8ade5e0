// rehearse as people and scripts meet it: sets of the product's simulator, of a program of the user's own, of several sessions.
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"

namespace touchstone::cli {
namespace {

using Json = nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class RehearseCommandTest : public RealBinaryTest {
 protected:
  void SetUp() override {
    RealBinaryTest::SetUp();
    Write("nominal.yaml", kNominalModelFile);
    ASSERT_EQ(Run({"plan", "lat20", "--plan", "faces", "--samples-per-face", "4", "--rounds", "2", "-o",
                   "plan.csv"})
                  .exit_code,
              0);
  }
  // A program in the folder, which begins as README says: its options in variables.
  void WriteGenerator(const std::string& name, const std::string& body) {
    Write(name,
          absl::StrCat("#!/bin/sh\nset -e\n"
                       "while [ $# -gt 0 ]; do case $1 in\n"
                       "  --plan) plan=$2 ;; --model) model=$2 ;; --output) output=$2 ;; --seed) seed=$2 ;;\n"
                       "  --session) session=$2 ;; --sessions) sessions=$2 ;; --mesh) mesh=$2 ;;\n"
                       "  --hide) hide=$2 ;; *) exit 9 ;; esac; shift 2; done\n",
                       body));
    ASSERT_EQ(::chmod(Path(name).c_str(), 0755), 0);
  }
  // One that hides what it is asked to by adding it to the model, and nothing outside the catalogue.
  void WriteTouching() {
    const std::string touchstone =
        std::filesystem::read_symlink("/proc/self/exe").parent_path() / "touchstone";
    WriteGenerator(
        "touching",
        absl::StrCat("case $hide in outside) exit 3 ;; esac\n"
                     "if [ -n \"$hide\" ]; then ",
                     touchstone, " model add \"$model\" $hide -o hidden.yaml; model=hidden.yaml; fi\n",
                     touchstone,
                     " touch --plan \"$plan\" --model \"$model\" --seed \"$seed\""
                     " -o \"$output\"\n"));
  }
  Outcome Rehearse(const std::vector<std::string>& more,
                   const std::vector<std::string>& plans = {"plan.csv"}) {
    std::vector<std::string> command = {"rehearse"};
    command.insert(command.end(), plans.begin(), plans.end());
    for (const char* word : {"--model", "nominal.yaml", "--effects", "tip_radius", "--pairs", "0"})
      command.emplace_back(word);
    command.insert(command.end(), more.begin(), more.end());
    return Run(command);
  }
};

TEST_F(RehearseCommandTest, AProgramOfTheUsersOwnMakesTheSets) {
  WriteTouching();
  const Outcome outcome = Rehearse({"--sets", "4", "--generator", "./touching", "--json", "rows.json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("The sets were made by ./touching."),
                                 HasSubstr("It cannot hide and left out: outside.")));
  const Json rows = Json::parse(Read("rows.json"));
  EXPECT_EQ(rows[0]["hidden"], "nothing");
  EXPECT_EQ(rows[0]["right"], 1);
  EXPECT_EQ(rows[1]["hidden"], "tip_radius");
  EXPECT_EQ(rows[1]["found"], 1);
  EXPECT_EQ(rows[3]["hidden"], "mistake");
  EXPECT_EQ(rows[3]["found"], 1);
  EXPECT_EQ(rows.back()["sets"], 3);
}

TEST_F(RehearseCommandTest, WhatAProgramDoesWrongIsSaid) {
  const auto error = [&](const std::string& body, const std::vector<std::string>& more = {"--sets", "1"}) {
    WriteGenerator("wrong", body);
    std::vector<std::string> options = {"--generator", "./wrong"};
    options.insert(options.end(), more.begin(), more.end());
    const Outcome outcome = Rehearse(options);
    EXPECT_NE(outcome.exit_code, 0);
    return outcome.err;
  };
  EXPECT_THAT(
      error("echo no licence >&2\nexit 7\n"),
      AllOf(HasSubstr("--generator: ./wrong (nothing, seed 1): exit status 7"), HasSubstr("no licence")));
  EXPECT_THAT(error("exit 0\n"), HasSubstr("no file at its --output was written; it said nothing"));
  EXPECT_THAT(error("cp \"$plan\" \"$output\"\n"), HasSubstr("its output has no column t_*_us"));
  EXPECT_THAT(error("echo object,t_0_us,t_1_us > \"$output\"\necho cup,1,2 >> \"$output\"\n"),
              HasSubstr("its output has 1 touches; the plan's 48 were expected"));
  EXPECT_THAT(error("exec sleep 1000\n", {"--sets", "1", "--generator-limit-s", "0.2"}),
              HasSubstr("has not ended after 0.2 s"));
  EXPECT_THAT(error("exit 3\n", {"--sets", "5"}), HasSubstr("hides none of the 4 cases"));
  EXPECT_THAT(Rehearse({"--sets", "1", "--generator", "nowhere"}).err, HasSubstr("no such program in PATH"));
  Write("plain", "");
  EXPECT_THAT(Rehearse({"--sets", "1", "--generator", "./plain"}).err, HasSubstr("is no executable file"));
  EXPECT_THAT(Rehearse({"--sets", "1", "--generator-limit-s", "3"}).err,
              HasSubstr("Give --generator PROGRAM"));
  EXPECT_THAT(Rehearse({"--sets", "1", "--generator", "./wrong", "--generator-limit-s", "0"}).err,
              HasSubstr("a positive number was expected"));
}

TEST_F(RehearseCommandTest, AChangeBetweenSessionsIsFoundAndNoOtherClaimed) {
  // nothing, tip_radius in all, outside, mistake, tip_radius in the last alone.
  const Outcome outcome = Rehearse({"--sets", "5", "--json", "-"}, {"plan.csv", "plan.csv"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const Json rows = Json::parse(outcome.out);
  EXPECT_EQ(rows[0]["right"], 1);
  EXPECT_EQ(rows[1]["right"], 1);
  EXPECT_EQ(rows[4]["hidden"], "tip_radius changed");
  EXPECT_EQ(rows[4]["found"], 1);
  EXPECT_EQ(rows[4]["right"], 1);
  EXPECT_EQ(rows[4]["confidently_wrong"], 0);
}

TEST_F(RehearseCommandTest, AProgramIsToldWhichSessionItMakesAndHidesInTheLastAlone) {
  WriteTouching();
  Write("touching", Read("touching") + "echo \"$session/$sessions:$hide\" >> " + Path("asked") + "\n");
  ASSERT_EQ(::chmod(Path("touching").c_str(), 0755), 0);
  const Outcome outcome = Rehearse({"--sets", "5", "--generator", "./touching"}, {"plan.csv", "plan.csv"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(Read("asked"),
            "1/2:\n2/2:\n1/2:tip_radius radius_mm=1.5\n2/2:tip_radius radius_mm=1.5\n"  // nothing; in all
            "1/2:\n2/2:\n"                                                              // mistake
            "1/2:\n2/2:tip_radius radius_mm=1.5\n");                                    // in the last
}

}  // namespace
}  // namespace touchstone::cli
