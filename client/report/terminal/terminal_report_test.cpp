#include <algorithm>
#include <cmath>
#include <regex>
#include <set>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/report/report.h"
#include "client/report/sample_reports.h"
#include "client/report/words/text_layout.h"

namespace touchstone::client {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::vector<std::string> Lines(const std::string& text) {
  return absl::StrSplit(text, '\n');
}

// The line that holds `piece`; empty if none or several do.
std::string LineWith(const std::string& text, const std::string& piece) {
  std::string found;
  for (const std::string& line : Lines(text)) {
    if (!absl::StrContains(line, piece)) continue;
    if (!found.empty()) return "";
    found = line;
  }
  return found;
}

int Bars(const std::string& line) {
  return static_cast<int>(std::count(line.begin(), line.end(), '#'));
}

TEST(TerminalReport, HasThePartsOfTheDesignInTheirOrder) {
  const std::string text = TerminalReport(MissingEffectsReport(), 120, false);
  size_t last = 0;
  for (const char* label :
       {"960 touches, 3 objects, 240 poses x 4 rounds. Noise floor 5.00 ms (0.10 mm at 20 mm/s), "
        "from 720 repeats.",
        "\nHow wrong   RMSE 41.0 ms, 8.2 times the floor: 98.5 % of the error", "\nWhere ", "\nWhy ",
        "\nLadder ", "\nWhat to do ", "To check on the rig: ", "\nNext touches ", "\nNot used "}) {
    const size_t at = text.find(label);
    ASSERT_NE(at, std::string::npos) << label << "\n" << text;
    EXPECT_GE(at, last) << label;
    last = at;
  }
}

TEST(TerminalReport, KeepsToItsWidth) {
  for (const NamedReport& sample : AllSampleReports()) {
    for (const int width : {60, 80, 100, 140}) {
      for (const std::string& line : Lines(TerminalReport(sample.report, width, true))) {
        if (absl::StrContains(line, "parameters: {")) continue;  // a line of a model file stays whole
        EXPECT_LE(Columns(line), width) << sample.name << ": " << line;
      }
    }
  }
}

TEST(TerminalReport, LeavesNoBlanksAtLineEnds) {
  for (const NamedReport& sample : AllSampleReports()) {
    for (const std::string& line : Lines(TerminalReport(sample.report, 100, false))) {
      EXPECT_FALSE(absl::EndsWith(line, " ")) << sample.name << ": '" << line << "'";
    }
  }
}

TEST(TerminalReport, ColoursOnlyWhenAsked) {
  const v1::Report report = MissingEffectsReport();
  EXPECT_THAT(TerminalReport(report, 100, false), Not(HasSubstr("\033")));
  const std::string coloured = TerminalReport(report, 100, true);
  EXPECT_THAT(coloured, HasSubstr("\033[1m"));
  // Without its escapes, the coloured text is the plain one.
  EXPECT_EQ(std::regex_replace(coloured, std::regex("\033\\[[0-9]*m"), ""),
            TerminalReport(report, 100, false));
}

TEST(TerminalReport, LadderBarsAreProportionalToTheErrors) {
  v1::Report report = MissingEffectsReport();
  v1::DataReport& data = *report.mutable_data(0);
  data.mutable_initial()->set_rmse(40000);
  data.mutable_after_step(0)->set_rmse(20000);
  data.mutable_after_step(1)->set_rmse(10000);
  report.mutable_steps(0)->clear_equivalent();
  const std::string text = TerminalReport(report, 140, false);
  const int full = Bars(LineWith(text, "nominal  "));
  EXPECT_EQ(full, 40);
  EXPECT_EQ(Bars(LineWith(text, "+ tip_radius  ")), full / 2);
  EXPECT_EQ(Bars(LineWith(text, "+ channel_latency  ##")), full / 4);
}

TEST(TerminalReport, LadderTellsUnseenTouchesAndLackOfFitWhereThereIsRoom) {
  const std::string rung = LineWith(TerminalReport(MissingEffectsReport(), 120, false), "  5.01 ms");
  EXPECT_THAT(rung, HasSubstr("5.03 ms"));
  EXPECT_THAT(rung, HasSubstr("0.44"));
}

TEST(TerminalReport, NamesWhatTheDataCannotTellApartAndWhatWouldDecide) {
  const std::string text = TerminalReport(MissingEffectsReport(), 200, false);
  EXPECT_THAT(text, HasSubstr("tip_radius or surface_offset: these data cannot tell them apart (one of "
                              "these: 0.99). To decide: touches on "
                              "the edge of a box"));
  EXPECT_THAT(text, HasSubstr("channel_latency or finger_length: these data cannot tell them apart."));
}

TEST(TerminalReport, SaysWhatIsKnownOfARestWithoutAFormula) {
  v1::Report report = UnexplainedReport();
  report.mutable_data(0)->mutable_unexplained()->Clear();
  const std::string words = "In 30 % of the touches finger l reports 20 ms later.";
  report.mutable_data(0)->mutable_unexplained()->set_words(words);
  EXPECT_THAT(TerminalReport(report, 120, false), HasSubstr(words));
}

TEST(TerminalReport, ShowsMistakesOfTheFileAndTheCommandInOnePiece) {
  const std::string text = TerminalReport(CheckDataReport(), 100, false);
  EXPECT_THAT(
      text,
      HasSubstr("lateral vectors reversed (lateral -> -lateral). RMSE of the given model 866 -> 14 ms"));
  EXPECT_THAT(
      text,
      HasSubstr("touchstone session fix measurements/lab-2026-03.csv --reverse-lateral -o fixed.csv\n"));
  EXPECT_THAT(TerminalReport(TooLittleDataReport(), 100, false), HasSubstr("16 usable touches would do"));
}

TEST(TerminalReport, CallsTheFloorAnUpperBoundWithoutRepeats) {
  EXPECT_THAT(TerminalReport(AdequateReport(), 120, false),
              HasSubstr("Noise floor at most 5.10 ms (0.10 mm at 20 mm/s), an upper bound"));
}

TEST(TerminalReport, ShowsTheFormulaAsItCanBeAdded) {
  const v1::Report report = UnexplainedReport();
  const std::string text = TerminalReport(report, 80, false);
  for (const std::string& line : Lines(report.data(0).unexplained().formula_yaml())) {
    EXPECT_THAT(text, HasSubstr(line));
  }
  EXPECT_THAT(text, HasSubstr("depends on travel (p 1e-9)"));
}

TEST(TerminalReport, TellsWhichValuesWereWrong) {
  const std::string text = TerminalReport(WrongValuesReport(), 100, false);
  EXPECT_THAT(text, HasSubstr("the values of contact_slowdown are off"));
  EXPECT_THAT(text, HasSubstr("0.183 +- 0.004, was 0.05"));
  EXPECT_THAT(LineWith(text, "refitted values"), HasSubstr("815 us"));
}

TEST(TerminalReport, TellsRowsThatWereNotUsedWithTheirReasons) {
  const std::string text = TerminalReport(MissingEffectsReport(), 120, false);
  EXPECT_THAT(text, HasSubstr("40 of 1000 rows"));
  EXPECT_THAT(text, HasSubstr("33: a finger within 0.3 mm of an edge (touches 12, 77, 103, 240, 391, ...)"));
}

TEST(TerminalReport, ComparesDistributionsWithoutPoses) {
  const std::string text = TerminalReport(WithoutPosesReport(), 120, false);
  EXPECT_THAT(text, HasSubstr("energy distance 0.213"));
  EXPECT_THAT(LineWith(text, "median gap"), HasSubstr("41.2 ms"));
  EXPECT_THAT(text, Not(HasSubstr("Ladder")));
}

TEST(TerminalReport, SaysNothingTwice) {
  for (const NamedReport& sample : AllSampleReports()) {
    std::set<std::string> seen;
    for (const std::string& line : Lines(TerminalReport(sample.report, 200, false))) {
      if (line.empty()) continue;
      EXPECT_TRUE(seen.insert(line).second) << sample.name << ": " << line;
    }
  }
}

TEST(TerminalReport, SaysThatAnEmptyReportComparesNothing) {
  EXPECT_EQ(TerminalReport(v1::Report(), 80, false), "0 touches.\n\nNothing could be compared.\n\n");
}

TEST(TextLayout, KeepsANumberAndItsUnitTogether) {
  TextLayout layout(60, false);
  layout.Lead(std::string(50, 'x') + " about 20 mm/s.");
  EXPECT_EQ(layout.Take(), std::string(50, 'x') + " about\n20 mm/s.\n");
}

TEST(BarLength, IsProportionalAndAtLeastOneForAnythingAboveZero) {
  EXPECT_EQ(BarLength(10, 40, 40), 10);
  EXPECT_EQ(BarLength(40, 40, 40), 40);
  EXPECT_EQ(BarLength(1e-6, 40, 40), 1);
  EXPECT_EQ(BarLength(0, 40, 40), 0);
  EXPECT_EQ(BarLength(std::nan(""), 40, 40), 0);
}

}  // namespace
}  // namespace touchstone::client
