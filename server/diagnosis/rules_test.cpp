#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_replace.h>

#include "server/base/numbers/rule.h"
#include "server/base/test_paths.h"
#include "server/base/text/text.h"
#include "server/diagnosis/answers/rules.h"
#include "server/diagnosis/boards/rules.h"
#include "server/diagnosis/checks/photographs/rules.h"
#include "server/diagnosis/checks/rows/rules.h"
#include "server/diagnosis/checks/rules.h"
#include "server/diagnosis/design/rules.h"
#include "server/diagnosis/distributions/rules.h"
#include "server/diagnosis/engine/competition/rules.h"
#include "server/diagnosis/engine/fit/rules.h"
#include "server/diagnosis/engine/ladder/rules.h"
#include "server/diagnosis/engine/rules.h"
#include "server/diagnosis/engine/search/rules.h"
#include "server/diagnosis/images/pixels/rules.h"
#include "server/diagnosis/images/rows/rules.h"
#include "server/diagnosis/images/rules.h"
#include "server/diagnosis/images/search/rules.h"
#include "server/diagnosis/images/terms/rules.h"
#include "server/diagnosis/joint/rules.h"
#include "server/diagnosis/report/message/rules.h"
#include "server/diagnosis/report/words/rules.h"
#include "server/diagnosis/residuals/distribution/rules.h"
#include "server/diagnosis/residuals/photographs/rules.h"
#include "server/diagnosis/residuals/rules.h"
#include "server/diagnosis/residuals/slices/rules.h"
#include "server/diagnosis/residuals/touches/rules.h"
#include "server/diagnosis/rules.h"
#include "server/diagnosis/selection/curves/rules.h"
#include "server/diagnosis/selection/ladder/rules.h"
#include "server/diagnosis/selection/rules.h"
#include "server/diagnosis/selection/scatter/rules.h"
#include "server/diagnosis/selection/session/rules.h"
#include "server/diagnosis/selection/surface/rules.h"
#include "server/diagnosis/touches/noise/rules.h"
#include "server/diagnosis/touches/rules.h"

namespace touchstone::diagnosis {
namespace {

struct Room {
  std::string name;  // of the folder, with dots
  std::vector<Rule<double>> rules;
};

std::vector<Room> Rooms() {
  return {{"answers", ListRules(kAnswerRules)},
          {"boards", ListRules(boards::kBoardRules)},
          {"checks.photographs", ListRules(checks::kPhotoCheckRules)},
          {"checks.rows", ListRules(checks::kRowCheckRules)},
          {"checks", ListRules(checks::kCheckRules)},
          {"design", ListRules(design::kDesignRules)},
          {"distributions", ListRules(distributions::kDistributionRules)},
          {"engine.competition", ListRules(engine::kCompetitionRules)},
          {"engine.fit", ListRules(engine::kFitRules)},
          {"engine.ladder", ListRules(engine::kLadderRules)},
          {"engine", ListRules(engine::kEngineRules)},
          {"engine.search", ListRules(engine::kCandidateRules)},
          {"images.pixels", ListRules(images::kPixelRules)},
          {"images.rows", ListRules(images::kPhotoRowRules)},
          {"images", ListRules(images::kImageRules)},
          {"images.search", ListRules(images::kPhotoSearchRules)},
          {"images.terms", ListRules(images::kPhotoTermRules)},
          {"joint", ListRules(joint::kJointRules)},
          {"report.message", ListRules(report::kMessageRules)},
          {"report.words", ListRules(report::kWordsRules)},
          {"residuals.distribution", ListRules(residuals::kDistributionRules)},
          {"residuals.photographs", ListRules(residuals::kPhotographResidualRules)},
          {"residuals", ListRules(residuals::kResidualRules)},
          {"residuals.slices", ListRules(residuals::kSliceRules)},
          {"residuals.touches", ListRules(residuals::kTouchResidualRules)},
          {"diagnosis", ListRules(kDiagnosisRules)},
          {"selection.curves", ListRules(selection::kCurveRules)},
          {"selection.ladder", ListRules(selection::kLadderRules)},
          {"selection", ListRules(selection::kSelectionRules)},
          {"selection.scatter", ListRules(selection::kScatterRules)},
          {"selection.session", ListRules(selection::kSessionRules)},
          {"selection.surface", ListRules(selection::kSurfaceRules)},
          {"touches.noise", ListRules(touches::kNoiseRules)},
          {"touches", ListRules(touches::kTouchRules)}};
}

TEST(Rules, HaveTheNameOfTheirFolderAndNoOther) {
  std::set<std::string> names;
  for (const Room& room : Rooms())
    for (const Rule<double>& rule : room.rules) {
      EXPECT_EQ(std::string(rule.name).rfind('.'), room.name.size()) << rule.name;
      EXPECT_TRUE(absl::StartsWith(rule.name, room.name + ".")) << rule.name;
      EXPECT_TRUE(names.insert(rule.name).second) << rule.name << " stands twice";
    }
  EXPECT_GT(names.size(), 300u);
}

std::string Cell(const char* text) {
  return absl::StrReplaceAll(text, {{"|", "\\|"}});
}

std::string Page() {
  std::string page =
      "# The numbers by which a diagnosis decides\n\n"
      "Every threshold, limit of work and grid of `server/diagnosis/`, printed from the `rules.h` of the "
      "folders by `rules_test.cpp`. What\n"
      "changes where a number is half or twice as large is measured by "
      "[tests/rules](../../tests/rules/README.md). \"Not recorded\": nobody\n"
      "wrote down where the number comes from; \"Not measured\": nobody has tried another one.\n";
  for (const Room& room : Rooms()) {
    absl::StrAppend(&page, "\n## ", room.name,
                    "\n\n| number | value | unit | decides | chosen | beyond |\n"
                    "| --- | --- | --- | --- | --- | --- |\n");
    for (const Rule<double>& rule : room.rules)
      absl::StrAppend(&page, "| `", std::string(rule.name).substr(room.name.size() + 1), "` | ",
                      absl::StrFormat("%.6g", rule.number), " | ", Cell(rule.unit), " | ", Cell(rule.decides),
                      " | ", Cell(rule.chosen), " | ", Cell(rule.beyond), " |\n");
  }
  return page;
}

TEST(Rules, StandInTheDocumentWithUnitReasonAndLimits) {
  const auto written = ReadFile(SourceDir() + "/server/diagnosis/RULES.md");
  ASSERT_TRUE(written.ok()) << written.status();
  const std::string page = Page(), made = testing::TempDir() + "touchstone-RULES.md";
  if (*written == page) return;
  std::ofstream(made) << page;
  FAIL() << "server/diagnosis/RULES.md is not what the headers say: cp " << made
         << " server/diagnosis/RULES.md";
}

TEST(Rules, SayWhatTheyDecideAndWhereTheyComeFrom) {
  for (const Room& room : Rooms())
    for (const Rule<double>& rule : room.rules)
      for (const std::string text : {rule.decides, rule.chosen, rule.beyond})
        EXPECT_TRUE(text.size() > 5 && text.back() == '.') << rule.name << ": '" << text << "'";
}

}  // namespace
}  // namespace touchstone::diagnosis
