// check, explain and compare with two models as people and scripts meet them: the real binary.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"
#include "client/source/dataset/measurement_csv.h"

namespace touchstone::cli {
namespace {

using Json = nlohmann::json;
using ::testing::AllOf;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

// A plan of 24 poses in two rounds on lat20, and what a rig with balls for tips measured of it: plan.csv, set.csv.
class QuestionCommandTest : public RealBinaryTest {
 protected:
  void MakePlan() {
    Write("nominal.yaml", kNominalModelFile);
    Write("tips.yaml", std::string(kNominalModelFile) + "  - tip_radius: {radius_mm: 3}\n");
    ASSERT_EQ(Run({"plan", "lat20", "--plan", "faces", "--samples-per-face", "4", "--rounds", "2", "-o",
                   "plan.csv"})
                  .exit_code,
              0);
  }
  void MakeSet() {
    MakePlan();
    ASSERT_EQ(Run({"touch", "--plan", "plan.csv", "--model", "tips.yaml", "-o", "set.csv"}).exit_code, 0);
  }
};

TEST_F(QuestionCommandTest, ACheckListsEveryEffectWithItsSize) {
  MakePlan();
  const Outcome outcome = Run({"check", "plan.csv", "--model", "nominal.yaml"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("48 touches on one object, noise 5.00 ms"), HasSubstr("tip_radius"),
                    HasSubstr("never: acts as clock_skew"), HasSubstr("found from")));
}

TEST_F(QuestionCommandTest, ACheckIsTheSameWhateverTheTimesOfTheSet) {
  MakeSet();
  const auto detectable = [&](const char* file) {
    return Json::parse(Run({"check", file, "--model", "nominal.yaml", "--json", "-"}).out)["detectable"];
  };
  EXPECT_EQ(detectable("plan.csv"), detectable("set.csv"));
}

TEST_F(QuestionCommandTest, WhatCannotBeAskedIsRefusedWithTheOption) {
  MakeSet();
  Write("empty.yaml", "touchstone: model/1\nname: empty\n");
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{"explain", "tipradius", "set.csv", "--model", "nominal.yaml"}, "did you mean 'tip_radius'?"},
      {{"check", "plan.csv", "--model", "nominal.yaml", "--find", "tipradius", "--improve", "3", "-o",
        "x.csv"},
       "did you mean 'tip_radius'?"},
      {{"rehearse", "plan.csv", "--model", "nominal.yaml", "--effects", "tipradius"},
       "did you mean 'tip_radius'?"},
      {{"check", "plan.csv", "--model", "nominal.yaml", "--noise", "1e30"},
       "--noise: 1e+30 us is out of range; above 0 to 1000000 us was expected"},
      {{"rehearse", "plan.csv", "--model", "nominal.yaml", "--sets", "0"}, "--sets: 0 is out of range"},
      {{"propose", "set.csv", "--model", "nominal.yaml", "--photographs", "3"},
       "--photographs: set.csv holds touches alone"},
      {{"propose", "set.csv", "--model", "nominal.yaml", "--touches", "1e9"},
       "--touches: 1000000000: at most 1000"},
      {{"explain", "tip_radius", "set.csv", "--model", "nominal.yaml", "--also", "empty.yaml"},
       "--also: empty.yaml has no effects"}};
  for (const auto& [arguments, words] : cases) {
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(words));
  }
}

TEST_F(QuestionCommandTest, TimesInMillisecondsAreRefusedWithTheCommandThatMendsThem) {
  MakeSet();
  auto rows = client::ParseMeasurements(Read("set.csv"), "set.csv");
  ASSERT_TRUE(rows.ok()) << rows.status();
  for (client::MeasuredTouch& row : *rows)
    for (double& time : row.time_s) time /= 1000;
  Write("ms.csv", client::FormatMeasurements(*rows));
  for (const std::vector<std::string>& question :
       {std::vector<std::string>{"compare"}, std::vector<std::string>{"explain", "tip_radius"}}) {
    std::vector<std::string> arguments = question;
    arguments.insert(arguments.end(), {"ms.csv", "--model", "nominal.yaml"});
    EXPECT_THAT(Run(arguments).err,
                HasSubstr("touchstone session fix ms.csv --scale-times 1000 -o fixed.csv"));
  }
}

TEST_F(QuestionCommandTest, OneTouchIsSaidToBeTooLittleByWhateverIsAsked) {
  MakeSet();
  const std::string set = Read("set.csv");
  Write("one.csv", set.substr(0, set.find('\n', set.find('\n') + 1) + 1));
  const Outcome explained = Run({"explain", "tip_radius", "one.csv", "--model", "nominal.yaml"});
  EXPECT_THAT(explained.out,
              AllOf(HasSubstr("one.csv: 1 touch, model"), HasSubstr("That is too little for a verdict"),
                    HasSubstr("16 usable touches would do")));
  const Outcome proposed = Run({"propose", "one.csv", "--model", "nominal.yaml"});
  EXPECT_THAT(proposed.err,
              HasSubstr("no touches to propose from so few: more are needed first (16 usable ones)"));
}

TEST_F(QuestionCommandTest, AHistoryLeavesOutASessionWhoseObjectHasNoMesh) {
  MakeSet();
  ASSERT_EQ(
      Run({"touch", "--plan", "plan.csv", "--model", "tips.yaml", "--seed", "9", "-o", "more.csv"}).exit_code,
      0);
  std::filesystem::create_directory(Path("days"));
  Write("days/monday.csv", Read("set.csv"));
  Write("days/tuesday.csv", absl::StrReplaceAll(Read("set.csv"), {{"lat20", "mug"}}));
  Write("days/wednesday.csv", Read("more.csv"));
  const Outcome outcome = Run({"history", "days", "--model", "nominal.yaml"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("note: left out: days/tuesday.csv"), HasSubstr("'mug' has no mesh")));
}

TEST_F(QuestionCommandTest, ProposedTouchesAreAPlanThatCanBeTouched) {
  MakePlan();
  const Outcome outcome = Run({"check", "plan.csv", "--model", "nominal.yaml", "--improve", "6", "--between",
                               "finger_length,channel_latency", "-o", "more.csv"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("6 touches: tells finger_length from channel_latency"));
  EXPECT_EQ(Run({"touch", "--plan", "more.csv", "-o", "touched.csv"}).exit_code, 0);
  EXPECT_THAT(*client::ParseMeasurements(Read("touched.csv"), "touched.csv"), SizeIs(6));
}

TEST_F(QuestionCommandTest, ACheckSaysWhatIsWrongWithTheQuestion) {
  MakePlan();
  const auto message = [&](std::vector<std::string> arguments) {
    std::vector<std::string> command = {"check", "plan.csv", "--model", "nominal.yaml"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    const Outcome outcome = Run(command);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    return outcome.err;
  };
  EXPECT_THAT(message({"--improve", "6", "--find", "tip_radius"}), HasSubstr("-o FILE was expected"));
  EXPECT_THAT(message({"--improve", "6", "-o", "more.csv"}), HasSubstr("depends on the question"));
  EXPECT_THAT(message({"--find", "tip_radius"}), HasSubstr("belong to --improve"));
  EXPECT_THAT(message({"--improve", "6", "--find", "tip_radios", "-o", "more.csv"}),
              HasSubstr("'tip_radios'"));
  EXPECT_THAT(message({"--noise", "-5"}),
              HasSubstr("--noise: -5 us is out of range; above 0 to 1000000 us was expected"));
  Write("silent.yaml", "touchstone: model/1\nname: silent\nend_effector: {fingers: 3, spacing_mm: 30}\n");
  const Outcome silent = Run({"check", "plan.csv", "--model", "silent.yaml"});
  EXPECT_THAT(silent.err, AllOf(HasSubstr("'silent' has no noise"), HasSubstr("--noise 5")));
}

TEST_F(QuestionCommandTest, APlanWithoutTimesIsRefusedWhereTimesAreRead) {
  MakePlan();
  EXPECT_THAT(Run({"explain", "tip_radius", "plan.csv", "--model", "nominal.yaml"}).err,
              HasSubstr("it is a plan"));
  EXPECT_THAT(Run({"compare", "plan.csv", "--model", "nominal.yaml"}).err, HasSubstr("it is a plan"));
}

TEST_F(QuestionCommandTest, AnExplanationNamesTheCauseInPlaceOfWhatWasAsked) {
  MakeSet();
  const Outcome outcome = Run({"explain", "object_scale", "set.csv", "--model", "nominal.yaml"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("tip_radius"), HasSubstr("Against it")));
  const Json cause =
      Json::parse(Run({"explain", "tip_radius", "set.csv", "--model", "nominal.yaml", "--json", "-"}).out);
  EXPECT_NEAR(cause["explained"]["parameters"][0]["value"].get<double>(), 3, 0.3);
}

TEST_F(QuestionCommandTest, OfTwoModelsTheTruthErrsLess) {
  MakeSet();
  const Outcome outcome = Run({"compare", "set.csv", "--model", "nominal.yaml", "--model", "tips.yaml"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("Two models"), HasSubstr("Deciding")));
  EXPECT_THAT(Run({"compare", "set.csv", "--model", "nominal.yaml"}).out, Not(HasSubstr("Two models")));
  EXPECT_THAT(Run({"diagnose", "set.csv", "--model", "nominal.yaml", "--model", "tips.yaml"}).err,
              HasSubstr("--model: given 2 times; once was expected"));
}

TEST_F(QuestionCommandTest, ARehearsalGoesOnWhereItWasStoppedAndEndsAlike) {
  MakePlan();
  const auto rehearse = [&](const char* sets, const char* state) {
    return Run({"rehearse", "plan.csv", "--model", "nominal.yaml", "--effects", "tip_radius", "--pairs", "0",
                "--sets", sets, "--state", state, "--json", "-"});
  };
  ASSERT_EQ(rehearse("2", "cut.jsonl").exit_code, 0);
  // What a kill leaves: a line that ends in the middle.
  Write("cut.jsonl", Read("cut.jsonl") + "{\"case\": \"outs");
  const Outcome resumed = rehearse("4", "cut.jsonl"), whole = rehearse("4", "whole.jsonl");
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_EQ(resumed.out, whole.out);
  EXPECT_EQ(Read("cut.jsonl"), Read("whole.jsonl"));
  const Json rows = Json::parse(whole.out);
  EXPECT_EQ(rows[0]["hidden"], "nothing");
  EXPECT_EQ(rows[1]["found"], 1);  // a tip of the usual size
  EXPECT_EQ(rows.back()["sets"], 4);
  Write("tips.csv", Read("plan.csv") + "48,lat20,20,60,0,0,0,0,0,-1,1,0,0,0\n");
  EXPECT_THAT(Run({"rehearse", "tips.csv", "--model", "nominal.yaml", "--effects", "tip_radius", "--pairs",
                   "0", "--sets", "4", "--state", "cut.jsonl"})
                  .err,
              HasSubstr("is of another plan"));
  EXPECT_THAT(Run({"rehearse", "plan.csv", "--model", "nominal.yaml", "--size", "much"}).err,
              HasSubstr("'found' was expected"));
}

}  // namespace
}  // namespace touchstone::cli
