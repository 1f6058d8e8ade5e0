// Several sessions in compare, diagnose and history as people and scripts meet them: the real binary.
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"

namespace touchstone::cli {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class SessionsCommandTest : public RealBinaryTest {
 protected:
  void SetUp() override {
    RealBinaryTest::SetUp();
    Write("nominal.yaml", kQuietModelFile);
    ASSERT_EQ(Run({"plan", "lat20", "--plan", "faces", "--samples-per-face", "4", "--rounds", "3", "-o",
                   "plan.csv"})
                  .exit_code,
              0);
  }
  // A session of the plan by a rig whose tips have this radius.
  void MakeSession(const std::string& file, double radius_mm, int seed) {
    Write("rig.yaml", absl::StrCat(kQuietModelFile, "  - tip_radius: {radius_mm: ", radius_mm, "}\n"));
    ASSERT_EQ(Run({"touch", "--plan", "plan.csv", "--model", "rig.yaml", "--seed", std::to_string(seed), "-o",
                   file})
                  .exit_code,
              0);
  }
};

TEST_F(SessionsCommandTest, DiagnoseNamesTheValueThatChangedAndSavesTheLastModel) {
  MakeSession("monday.csv", 1, 1);
  MakeSession("friday.csv", 2, 2);
  const Outcome outcome =
      Run({"diagnose", "monday.csv", "friday.csv", "--model", "nominal.yaml", "--save-model", "better.yaml"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("2 sessions, 144 touches"), HasSubstr("MISSING_EFFECTS"),
                                 HasSubstr("Changed: tip_radius radius_mm from"), HasSubstr("in friday.csv"),
                                 HasSubstr("changed by +")));
  // The saved model is that of Friday: a comparison of both finds it right there, and off on Monday.
  const auto compared = nlohmann::json::parse(
      Run({"compare", "monday.csv", "friday.csv", "--model", "better.yaml", "--json", "-"}).out);
  EXPECT_GT(compared["data"][0]["initial"]["rmse"], 1.3 * double(compared["data"][0]["noise_floor"]));
  EXPECT_LT(compared["data"][1]["initial"]["rmse"], 1.2 * double(compared["data"][1]["noise_floor"]));
  EXPECT_LT(compared["sessions"]["same_poses"][0]["p"], 1e-4);
}

TEST_F(SessionsCommandTest, SessionsOfASteadyRigAreSaidToAgree) {
  MakeSession("monday.csv", 1, 1);
  MakeSession("friday.csv", 1, 2);
  const Outcome outcome = Run({"diagnose", "monday.csv", "friday.csv", "--model", "rig.yaml"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("ADEQUATE: Nothing is missing and nothing changed"),
                                 HasSubstr("unchanged, within"), Not(HasSubstr("Changed"))));
}

TEST_F(SessionsCommandTest, HistoryMarksTheSessionOutsideItsLimits) {
  std::filesystem::create_directory(Path("days"));
  for (int day = 1; day <= 5; ++day)
    MakeSession(absl::StrCat("days/2026-11-0", day, ".csv"), day == 4 ? 2 : 1, day);
  std::filesystem::copy(Path("plan.csv"), Path("days/plan.csv"));
  const Outcome outcome = Run({"history", "days", "--model", "nominal.yaml"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("days/plan.csv is a plan, without times"));
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("5 sessions, model 'nominal'"), HasSubstr("tip_radius radius_mm")));
  for (int day = 1; day <= 5; ++day) {
    const std::string name = absl::StrCat("2026-11-0", day, ".csv");
    const size_t line = outcome.out.rfind(name);
    ASSERT_NE(line, std::string::npos) << outcome.out;
    const std::string rest = outcome.out.substr(line, outcome.out.find('\n', line) - line);
    EXPECT_EQ(rest.find("outside") != std::string::npos, day == 4) << rest;
  }
}

// A value that noise alone moves is called unchanged, and nothing else; the session in which it changed is named.
TEST_F(SessionsCommandTest, HistorySaysOneThingOfAValue) {
  std::filesystem::create_directory(Path("steady"));
  std::filesystem::create_directory(Path("moved"));
  for (int day = 1; day <= 3; ++day) {
    MakeSession(absl::StrCat("steady/", day, ".csv"), 1, day);
    MakeSession(absl::StrCat("moved/", day, ".csv"), day == 1 ? 1 : 2, day);
  }
  Write("rig.yaml", absl::StrCat(kQuietModelFile, "  - tip_radius: {radius_mm: 1}\n"));
  const Outcome steady = Run({"history", "steady", "--model", "rig.yaml"});
  EXPECT_THAT(steady.out, AllOf(HasSubstr("No value of the model changed"), HasSubstr("Unchanged"),
                                Not(HasSubstr("catters"))));
  const Outcome moved = Run({"history", "moved", "--model", "rig.yaml"});
  EXPECT_THAT(moved.out,
              AllOf(HasSubstr("mm in 1.csv to"), HasSubstr("2.csv and 3.csv"), Not(HasSubstr("Unchanged"))));
}

TEST_F(SessionsCommandTest, MistakesAreNamed) {
  MakeSession("monday.csv", 1, 1);
  std::filesystem::create_directory(Path("days"));
  std::filesystem::copy(Path("monday.csv"), Path("days/monday.csv"));
  std::filesystem::create_directory(Path("empty"));
  const auto message = [&](const std::vector<std::string>& command) {
    const Outcome outcome = Run(command);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    return outcome.err;
  };
  EXPECT_THAT(message({"history", "empty"}), HasSubstr("holds no session"));
  EXPECT_THAT(message({"history", "days"}), HasSubstr("holds one session"));
  EXPECT_THAT(Run({"history", "nowhere"}).err, HasSubstr("'nowhere'"));
  EXPECT_THAT(
      message({"compare", "monday.csv", "monday.csv", "--model", "rig.yaml", "--model", "nominal.yaml"}),
      HasSubstr("several sessions take one model"));
  EXPECT_THAT(message({"diagnose", "monday.csv", "monday.csv", "--with-formula", "--save-model", "x.yaml"}),
              HasSubstr("--with-formula: is for one SET, and 2 are given"));
  EXPECT_THAT(Run({"compare", "monday.csv", "plan.csv", "--model", "rig.yaml"}).err,
              HasSubstr("plan.csv:1: has no column t_*_us"));
}

// What is read must not be written over, in a folder either.
TEST_F(SessionsCommandTest, HistoryDoesNotWriteOverASession) {
  std::filesystem::create_directory(Path("days"));
  MakeSession("days/1.csv", 1, 1);
  MakeSession("days/2.csv", 1, 2);
  const std::string before = Read("days/1.csv");
  const Outcome outcome = Run({"history", "days", "--model", "rig.yaml", "--json", "days/1.csv", "--force"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("days/1.csv"));
  EXPECT_EQ(Read("days/1.csv"), before);
}

}  // namespace
}  // namespace touchstone::cli
