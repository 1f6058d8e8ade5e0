// compare, diagnose, propose and session as people and scripts meet them: the real binary, on a small set
// that `touchstone touch` made under a model with an effect.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_replace.h>
#include <absl/strings/str_split.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <thread>

#include <nlohmann/json.hpp>

#include "client/cli/tests/real_binary_test.h"
#include "client/cli/tests/test_server.h"
#include "client/source/dataset/measurement_csv.h"

namespace touchstone::cli {
namespace {

using Json = nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class DiagnoseCommandTest : public RealBinaryTest {
 protected:
  // 24 poses `rounds` times on each of two objects, touched with balls for tips: set.csv. The meshes have names
  // of their own.
  void MakeSet(int rounds = 2) {
    Write("nominal.yaml", kNominalModelFile);
    Write("tips.yaml", absl::StrCat(kNominalModelFile, "  - tip_radius: {radius_mm: 3}\n"));
    std::filesystem::create_directories(Path("meshes"));
    const std::pair<const char*, const char*> shapes[] = {{"cup", "lat05"}, {"mug", "lat20"}};
    std::vector<client::MeasuredTouch> touches;
    for (const auto& [name, shape] : shapes) {
      ASSERT_EQ(Run({"mesh", "supershape", shape, "--triangles", "2000", "-o",
                     absl::StrCat("meshes/", name, ".off")})
                    .exit_code,
                0);
      ASSERT_EQ(Run({"plan", name, "--mesh-dir", "meshes", "--plan", "faces", "--samples-per-face", "4",
                     "--rounds", std::to_string(rounds), "-o", absl::StrCat(name, "_plan.csv")})
                    .exit_code,
                0);
      const Outcome outcome = Run({"touch", "--plan", absl::StrCat(name, "_plan.csv"), "--mesh-dir", "meshes",
                                   "--model", "tips.yaml", "--seed", std::to_string(touches.size() + 1)});
      ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
      auto some = client::ParseMeasurements(outcome.out, "touch");
      ASSERT_TRUE(some.ok()) << some.status();
      for (client::MeasuredTouch& touch : *some) {
        touch.touch = touches.size();
        touch.object = name;
        touches.push_back(std::move(touch));
      }
    }
    Write("set.csv", client::FormatMeasurements(touches));
  }

  std::vector<std::string> Command(const std::string& command, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {command,        "set.csv",    "--model",
                                          "nominal.yaml", "--mesh-dir", "meshes"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }

  // set.csv with the field of a column changed in its n-th row (from 1); the whole column with row 0.
  std::string Changed(const std::string& column, int row,
                      const std::function<std::string(std::string)>& change) {
    std::vector<std::string> lines = absl::StrSplit(Read("set.csv"), '\n');
    const std::vector<std::string> names = absl::StrSplit(lines[0], ',');
    const size_t at = std::find(names.begin(), names.end(), column) - names.begin();
    for (size_t line = 1; line < lines.size(); ++line) {
      if (lines[line].empty() || (row != 0 && static_cast<int>(line) != row)) continue;
      std::vector<std::string> fields = absl::StrSplit(lines[line], ',');
      fields.at(at) = change(fields.at(at));
      lines[line] = absl::StrJoin(fields, ",");
    }
    return absl::StrJoin(lines, "\n");
  }
};

// What two runs may differ in.
// What two calls for the same report differ in: how long they took, and what the client says of the call.
Json WithoutDuration(const std::string& text) {
  Json report = Json::parse(text);
  report.erase("duration_s");
  if (report.contains("provenance"))
    for (const char* call : {"command", "date"}) report["provenance"].erase(call);
  return report;
}

TEST_F(DiagnoseCommandTest, FindsWhatIsMissingAndSavesTheModelThatHasIt) {
  MakeSet();
  const Outcome before = Run(Command("compare", {"--json", "before.json"}));
  ASSERT_EQ(before.exit_code, 0) << before.err;
  EXPECT_THAT(before.out, HasSubstr("96 touches"));
  const Outcome outcome = Run(
      Command("diagnose", {"--json", "report.json", "--html", "report.html", "--save-model", "better.yaml"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("tip_radius"));
  EXPECT_THAT(outcome.err, HasSubstr("wrote better.yaml (nominal_better, hash "));
  const Json report = Json::parse(Read("report.json"));
  // The page, Python and this command write the bytes of the report.
  EXPECT_EQ(Read("better.yaml"), report["improved_model_yaml"]);
  EXPECT_EQ(report["verdict"], "MISSING_EFFECTS");
  ASSERT_GE(report["steps"].size(), 1u);
  EXPECT_EQ(report["steps"][0]["effect"], "tip_radius");
  EXPECT_NEAR(report["steps"][0]["parameters"][0]["value"], 3, 0.5);
  EXPECT_THAT(Read("report.html"), HasSubstr("</html>"));

  const Outcome after =
      Run({"compare", "set.csv", "--model", "better.yaml", "--mesh-dir", "meshes", "--json", "-"});
  ASSERT_EQ(after.exit_code, 0) << after.err;
  EXPECT_LT(Json::parse(after.out)["data"][0]["initial"]["rmse"],
            0.5 * Json::parse(Read("before.json"))["data"][0]["initial"]["rmse"].get<double>());
}

TEST_F(DiagnoseCommandTest, AServerGivesTheSameNumbersAndKeepsTheModel) {
  MakeSet();
  service::ServerOptions options;
  options.supershape_triangles = 1000;
  options.threads = 1;
  const TestServer server(options);
  const std::string address = server.address();

  const Outcome here = Run(Command("diagnose", {"--json", "-", "--seed", "4"}));
  ASSERT_EQ(here.exit_code, 0) << here.err;
  const Outcome there =
      Run(Command("diagnose", {"--json", "-", "--seed", "4", "--server", address, "--keep-as", "kept"}));
  ASSERT_EQ(there.exit_code, 0) << there.err;
  EXPECT_EQ(WithoutDuration(here.out), WithoutDuration(there.out));
  const Outcome kept = Run({"model", "show", "kept", "--server", address});
  EXPECT_THAT(kept.out, HasSubstr("tip_radius")) << kept.err;
  const Outcome taken =
      Run(Command("diagnose", {"--json", "again.json", "--server", address, "--keep-as", "kept"}));
  EXPECT_EQ(taken.exit_code, 2);
  EXPECT_THAT(taken.err, HasSubstr("--keep-as: the server has a model 'kept' already (hash "));
  EXPECT_FALSE(std::filesystem::exists(Path("again.json"))) << "it is known before the diagnosis";

  // The same as a stored session, whose meshes are sent along.
  ASSERT_EQ(Run({"session", "create", "monday", "set.csv", "--server", address}).exit_code, 0);
  const Outcome stored = Run({"compare", "monday", "--model", "nominal.yaml", "--mesh-dir", "meshes",
                              "--server", address, "--json", "-"});
  ASSERT_EQ(stored.exit_code, 0) << stored.err;
  EXPECT_EQ(Json::parse(stored.out)["data"][0]["initial"], Json::parse(here.out)["data"][0]["initial"]);
}

TEST_F(DiagnoseCommandTest, SessionsAreStoredListedExportedAndDeleted) {
  Write("set.csv", "object,t_l_us,t_m_us,t_r_us\nlat00,1,0,2\n");
  Write("other.csv", "object,t_l_us,t_m_us,t_r_us\nlat00,1,0,3\n");
  service::ServerOptions options;
  options.supershape_triangles = 1000;
  const TestServer server(options);
  const std::string at = "--server=" + server.address();

  EXPECT_THAT(Run({"session", "create", "monday", "set.csv", at}).err,
              HasSubstr("stored as monday: 1 touch"));
  EXPECT_EQ(Run({"session", "create", "monday", "set.csv", at}).exit_code, 0);
  const Outcome taken = Run({"session", "create", "monday", "other.csv", at});
  EXPECT_EQ(taken.exit_code, 2);
  EXPECT_THAT(taken.err, HasSubstr("session 'monday' stands for other bytes"));
  // The server knows a name; the file is the one to open.
  Write("bad.csv", "object,t_l_us,t_m_us,t_r_us\nlat00,1,0,nan\n");
  EXPECT_THAT(Run({"session", "create", "friday", "bad.csv", at}).err,
              HasSubstr("error: bad.csv:2: column t_r_us"));
  EXPECT_THAT(Run({"session", "create", "../x", "set.csv", at}).err, HasSubstr("name = '../x'"));
  EXPECT_EQ(Run({"session", "create", "checked", "other.csv", "--check", at}).exit_code, 0);
  const Json list = Json::parse(Run({"session", "list", "--json", at}).out);
  ASSERT_EQ(list["sessions"].size(), 1u);
  EXPECT_EQ(list["sessions"][0]["name"], "monday");
  EXPECT_EQ(list["sessions"][0]["has_poses"], false);
  EXPECT_EQ(Run({"session", "export", "monday", at}).out, Read("set.csv"));
  EXPECT_THAT(Run({"session", "show", "mondy", at}).err, HasSubstr("did you mean 'monday'?"));
  EXPECT_EQ(Run({"session", "delete", "monday", at}).exit_code, 0);
  EXPECT_EQ(Run({"session", "show", "monday", at}).exit_code, 2);
  EXPECT_THAT(Run({"session", "list", at}).err, HasSubstr("keeps no session"));
  EXPECT_THAT(Run({"session", "list", "--deleted", at}).err, HasSubstr("Nothing is in the trash"));
  EXPECT_THAT(Run({"session", "list"}).err, HasSubstr("--server is missing"));
}

TEST_F(DiagnoseCommandTest, AProposedPlanCanBeTouched) {
  MakeSet();
  const Outcome outcome = Run(Command("propose", {"--touches", "6", "-o", "next.csv"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  if (!std::filesystem::exists(Path("next.csv"))) {
    EXPECT_THAT(outcome.err, HasSubstr("no touches to propose"));
    return;
  }
  const Outcome touched = Run({"touch", "--plan", "next.csv", "--mesh-dir", "meshes", "-o", "more.csv"});
  EXPECT_EQ(touched.exit_code, 0) << touched.err;
  EXPECT_LE(client::ParseMeasurements(Read("more.csv"), "more.csv")->size(), 6u);
}

TEST_F(DiagnoseCommandTest, BadInputIsNamedWithItsPlace) {
  MakeSet();
  const auto message = [&](const std::string& csv) {
    Write("bad.csv", csv);
    const Outcome outcome = Run({"compare", "bad.csv", "--model", "nominal.yaml", "--mesh-dir", "meshes"});
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_EQ(outcome.out, "");
    return outcome.err;
  };
  const std::string set = Read("set.csv");
  EXPECT_THAT(message(absl::StrReplaceAll(set, {{"approach_y", "cov_y"}})),
              HasSubstr("bad.csv:1: column 'approach_y' is missing"));
  EXPECT_THAT(message(absl::StrReplaceAll(set, {{"t_r_us", "cov_r"}})),
              HasSubstr("a column 't_r_us' was expected"));
  EXPECT_THAT(message(absl::StrReplaceAll(set, {{"speed_mm_s", "sped_mm_s"}})),
              HasSubstr("'sped_mm_s' is no column of a measurement file, did you mean 'speed_mm_s'?"));
  EXPECT_THAT(message(Changed("t_m_us", 5, [](const std::string&) { return "nan"; })),
              HasSubstr("bad.csv:6: column t_m_us: 'nan' is not a finite number"));
  EXPECT_THAT(message(Changed("touch", 9, [](const std::string&) { return "3"; })),
              HasSubstr("bad.csv:10: column touch: 3 stands on line 5 already"));
  EXPECT_THAT(message(Changed("object", 7, [](const std::string&) { return "cap"; })),
              AllOf(HasSubstr("bad.csv:8: column object: 'cap' has no mesh"), HasSubstr("--mesh cap=FILE"),
                    HasSubstr("did you mean 'cup'?")));
  EXPECT_THAT(message(""), HasSubstr("bad.csv:1: a header line was expected"));
  EXPECT_THAT(message(set.substr(0, set.find('\n') + 1)), HasSubstr("has a header but no touch"));
  EXPECT_THAT(message(Read("nominal.yaml")), HasSubstr("bad.csv:1: column 1"));
}

TEST_F(DiagnoseCommandTest, TimesInMillisecondsAreNoticed) {
  MakeSet();
  for (const char* column : {"t_l_us", "t_m_us", "t_r_us"})
    Write("set.csv", Changed(column, 0, [](const std::string& time) {
            return time.empty() ? time : std::to_string(std::stod(time) / 1000);
          }));
  const Outcome outcome = Run(Command("compare"));
  // An honest report or a refusal; either way it says that the unit is suspect.
  EXPECT_THAT(outcome.exit_code, ::testing::AnyOf(0, 2));
  EXPECT_THAT(outcome.out + outcome.err, HasSubstr("milliseconds"));
}

TEST_F(DiagnoseCommandTest, WhatIsReadIsNeverWrittenOver) {
  MakeSet();
  const std::string set = Read("set.csv");
  for (const std::string option : {"--json", "--html", "--save-model"}) {
    const Outcome outcome = Run(Command("diagnose", {option, "set.csv"}));
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(option + ": set.csv is set.csv, which is read and never changed"));
  }
  EXPECT_EQ(Read("set.csv"), set);
  EXPECT_THAT(Run(Command("diagnose", {"--save-model", "./nominal.yaml"})).err, HasSubstr("never changed"));
  EXPECT_EQ(Read("nominal.yaml"), kNominalModelFile);
  const std::string mesh = Read("meshes/cup.off");
  EXPECT_THAT(Run(Command("propose", {"-o", "meshes/cup.off", "--force"})).err, HasSubstr("never changed"));
  EXPECT_EQ(Read("meshes/cup.off"), mesh);
  EXPECT_THAT(Run(Command("propose", {"-o", "meshes/new.off"})).err, HasSubstr("would be a mesh"));
  EXPECT_THAT(Run(Command("compare", {"--json", "a", "--html", "a"})).err,
              HasSubstr("one would replace the other"));
}

TEST_F(DiagnoseCommandTest, OnlyMeshesThatTheSetNamesAreRead) {
  MakeSet();
  Write("meshes/broken.off", "this is no mesh");
  EXPECT_EQ(Run(Command("compare", {"-q"})).exit_code, 0);
  // OFF comes before STL, with a note to the user.
  Write("meshes/cup.stl", "nor is this");
  const Outcome two_files = Run(Command("compare"));
  EXPECT_EQ(two_files.exit_code, 0);
  EXPECT_THAT(two_files.err, HasSubstr("meshes/cup.off is taken (--mesh cup=FILE takes another)"));
  EXPECT_EQ(Run(Command("compare", {"--mesh", "cup=meshes/cup.off"})).exit_code, 0);
  EXPECT_THAT(Run(Command("compare", {"--mesh", "cup=meshes/broken.off"})).err,
              HasSubstr("meshes/broken.off"));
}

TEST_F(DiagnoseCommandTest, AUsersFormulaMayStandAlone) {
  MakeSet();
  Write("mine.yaml",
        "formula:\n  name: mine\n  adds: travel_mm\n  expression: \"k * finger\"\n"
        "  parameters: {k: {value: 0, unit: mm, min: -1, max: 1}}\n");
  const Outcome outcome = Run(Command("diagnose", {"--also", "mine.yaml", "--json", "-"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("formula mine"));
  Write("mine.yaml", "formula:\n  name: mine\n  adds: travel_mm\n  expression: \"k * fingr\"\n");
  const Outcome wrong = Run(Command("diagnose", {"--also", "mine.yaml"}));
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, AllOf(HasSubstr("mine.yaml"), HasSubstr("fingr")));
}

// Kind: a session of several objects is touched in parts, and what a touch leaves behind must not end with a part.
TEST_F(DiagnoseCommandTest, TouchesOfSeveralObjectsAreOneSession) {
  Write("memory.yaml",
        "touchstone: model/1\nname: memory\neffects:\n  - return_hysteresis: {fraction: 0.02}\n"
        "  - formula: {name: rest, adds: travel_mm, expression: \"0.01 * finger * pause_s\"}\n");
  ASSERT_EQ(Run({"plan", "lat00,lat20", "--plan", "faces", "--samples-per-face", "4", "--rounds", "2",
                 "--touch-interval-s", "8", "-o", "plan.csv"})
                .exit_code,
            0);
  auto touches = client::ParseMeasurements(Read("plan.csv"), "plan.csv");
  ASSERT_TRUE(touches.ok()) << touches.status();
  const size_t of_each = touches->size() / 2;
  std::vector<client::MeasuredTouch> by_turns;
  for (size_t k = 0; k < of_each; ++k)
    for (const size_t row : {k, of_each + k}) {
      by_turns.push_back((*touches)[row]);
      by_turns.back().touch = by_turns.size() - 1;
      by_turns.back().commanded.set_session_time_s(7.0 * by_turns.size() + (k % 3));
    }
  Write("by_turns.csv", client::FormatMeasurements(by_turns));
  ASSERT_EQ(Run({"touch", "--plan", "by_turns.csv", "--model", "memory.yaml", "-o", "set.csv"}).exit_code, 0);
  const Outcome compared = Run({"compare", "set.csv", "--model", "memory.yaml", "--json", "-"});
  ASSERT_EQ(compared.exit_code, 0) << compared.err;
  EXPECT_LT(Json::parse(compared.out)["data"][0]["initial"]["rmse"].get<double>(), 0.01) << "us";
}

TEST_F(DiagnoseCommandTest, HelpBeginsWithExamples) {
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"compare"}, {"diagnose"}, {"propose"}, {"session"}, {"session", "create"}}) {
    std::vector<std::string> arguments = command;
    arguments.push_back("--help");
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, 0);
    ASSERT_NE(outcome.out.find("Examples:"), std::string::npos) << outcome.out;
    EXPECT_LT(outcome.out.find("Examples:"), outcome.out.find("Usage:"));
  }
}

TEST_F(DiagnoseCommandTest, AnInterruptEndsItSoon) {
  // Large, and of a model slow enough, that it is at work for long.
  MakeSet(200);
  std::string model = kNominalModelFile, terms = "travel_mm";
  for (int k = 1; k < 40; ++k) absl::StrAppend(&terms, "+sin(", k, "*travel_mm)");
  for (int k = 0; k < 20; ++k)
    absl::StrAppend(&model, "  - formula: {name: slow", k, ", adds: time_us, expression: \"k*(", terms,
                    ")\", parameters: {k: {value: ", k, ", unit: us, min: -99, max: 99}}}\n");
  Write("nominal.yaml", model);
  const pid_t child = Start(Command("diagnose"));
  // Until it takes the signal; before, the signal would end it with the same status.
  while (!Catches(child, SIGINT) && !HasEnded(child))
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  // Somewhere in its work.
  while (ProcessorTimeS(child) < 0.3 && !HasEnded(child))
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  ::kill(child, SIGINT);
  const Outcome outcome = Wait(child);
  EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
  EXPECT_EQ(outcome.out, "") << "it went on to its end";
}

}  // namespace
}  // namespace touchstone::cli
