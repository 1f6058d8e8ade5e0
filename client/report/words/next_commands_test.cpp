#include "client/report/words/next_commands.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/report/sample_reports.h"

namespace touchstone::client {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<std::string> CommandsOf(v1::Report report, const std::string& command) {
  report.mutable_provenance()->set_command(command);
  std::vector<std::string> commands;
  for (const NextCommand& next : NextCommands(report)) commands.push_back(next.command);
  return commands;
}

TEST(NextCommands, SaveCompareAndProposeWithTheSameDataAndMeshes) {
  EXPECT_THAT(
      CommandsOf(
          MissingEffectsReport(),
          "touchstone diagnose 'my set.csv' --model nominal.yaml --mesh-dir meshes --html r.html --force"),
      ElementsAre(
          "touchstone diagnose 'my set.csv' --model nominal.yaml --mesh-dir meshes --save-model better.yaml",
          "touchstone compare 'my set.csv' --mesh-dir meshes --model better.yaml",
          "touchstone propose 'my set.csv' --model nominal.yaml --mesh-dir meshes -o plan.csv"));
}

TEST(NextCommands, CompareWhatWasSaved) {
  EXPECT_THAT(CommandsOf(MissingEffectsReport(),
                         "touchstone diagnose set.csv --model=n.yaml --save-model found.yaml"),
              ElementsAre("touchstone compare set.csv --model found.yaml",
                          "touchstone propose set.csv --model=n.yaml -o plan.csv"));
}

TEST(NextCommands, CompareWhatAServerKeeps) {
  EXPECT_THAT(CommandsOf(MissingEffectsReport(),
                         "touchstone diagnose set.csv --model n.yaml --server s:1 --keep-as found"),
              ElementsAre("touchstone compare set.csv --server s:1 --model found",
                          "touchstone propose set.csv --model n.yaml --server s:1 -o plan.csv"));
}

TEST(NextCommands, ProposeWhereNothingChanged) {
  EXPECT_THAT(CommandsOf(AdequateReport(), "touchstone diagnose set.csv --model n.yaml"),
              ElementsAre("touchstone propose set.csv --model n.yaml -o plan.csv"));
}

TEST(NextCommands, SaveTheSuggestionWhereNoEffectExplainsTheRest) {
  v1::Report report = UnexplainedReport();
  report.mutable_data(0)->mutable_unexplained()->set_model_yaml("touchstone: model/1\n");
  EXPECT_THAT(CommandsOf(report, "touchstone diagnose set.csv --model n.yaml"),
              testing::Contains(
                  "touchstone diagnose set.csv --model n.yaml --save-model better.yaml --with-formula"));
}

TEST(NextCommands, AreNotMadeUp) {
  EXPECT_THAT(CommandsOf(MissingEffectsReport(), ""), IsEmpty());
  EXPECT_THAT(CommandsOf(CompareReport(), "touchstone compare set.csv --model n.yaml"), IsEmpty());
  EXPECT_THAT(CommandsOf(CheckDataReport(), "touchstone diagnose set.csv --model n.yaml"), IsEmpty());
}

}  // namespace
}  // namespace touchstone::client
