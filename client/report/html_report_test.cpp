#include <absl/strings/match.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>

#include "client/report/occurrences.h"
#include "client/report/report.h"
#include "client/report/sample_reports.h"
#include "client/workbench/page.h"

namespace touchstone::client {
namespace {

using nlohmann::json;

json DataOfPage(const v1::Report& report) {
  return json::parse(*PageData(report));
}

// What stands between the data's <script> and its end; a build without the page has none.
std::string DataInside(const std::string& page) {
  const std::string begin = "id=\"touchstone-data\">";
  const size_t at = page.find(begin) + begin.size();
  return page.substr(at, page.find("</script>", at) - at);
}

TEST(HtmlReport, KeepsWhatUsersNamedInsideTheData) {
  const std::string evil = "</script><script>alert('x')</script>\"<img src=x onerror=alert(1)>\u202e";
  v1::Report report = MissingEffectsReport();
  report.set_model_name(evil);
  report.add_warnings(evil);
  report.mutable_data(0)->set_session(evil);
  report.mutable_data(0)->mutable_set()->set_objects(0, evil);
  for (auto& step : *report.mutable_steps()) step.set_effect(evil);
  for (auto& curve : *report.mutable_data(0)->mutable_curves()) curve.set_covariate(evil);
  if (!workbench::PageTemplate().ok()) GTEST_SKIP() << workbench::PageTemplate().status();
  const std::string page = *HtmlReport(report);
  EXPECT_EQ(Occurrences(page, "<script>alert"), 0);
  EXPECT_EQ(Occurrences(page, "<img src=x"), 0);
  EXPECT_EQ(Occurrences(page, "\u202e"), 0) << "it turns the direction of what follows";
  const json data = json::parse(DataInside(page));
  EXPECT_EQ(data["report"]["model_name"], evil);
  EXPECT_EQ(data["report"]["data"][0]["set"]["objects"][0], evil);
}

TEST(HtmlReport, SaysWhatIsMissingWhereThereIsNoPage) {
  if (workbench::PageTemplate().ok()) GTEST_SKIP() << "this build has the page";
  EXPECT_THAT(std::string(HtmlReport(AdequateReport()).status().message()), testing::HasSubstr("npm"));
}

TEST(PageData, HasTheReportAndTheSentencesOfTheTerminal) {
  for (const NamedReport& sample : AllSampleReports()) {
    const json data = DataOfPage(sample.report);
    EXPECT_FALSE(data["words"]["headline"].get<std::string>().empty()) << sample.name;
    EXPECT_EQ(data["words"]["of_data"].size(), data["report"]["data"].size()) << sample.name;
    EXPECT_EQ(data["words"]["steps"].size(), data["report"]["steps"].size()) << sample.name;
  }
}

TEST(PageData, NamesTheRungsOfTheLadder) {
  const json rungs = DataOfPage(MissingEffectsReport())["words"]["ladder"];
  ASSERT_GE(rungs.size(), 4u);
  EXPECT_EQ(rungs.front()["kind"], "given");
  EXPECT_EQ(rungs.back()["kind"], "floor");
  EXPECT_TRUE(rungs.back()["heldout_rmse"].is_null());
}

TEST(PageData, OfAJointReportHasALadderForEachKind) {
  const json words = DataOfPage(JointReport())["words"];
  for (int kind = 0; kind < 2; ++kind) {
    const json& rungs = words["of_data"][kind]["ladder"];
    ASSERT_EQ(rungs.size(), 4u);
    EXPECT_EQ(rungs[0]["rmse"], kind == 0 ? 41000 : 6.03);
  }
  EXPECT_FALSE(DataOfPage(MissingEffectsReport())["words"]["of_data"][0].contains("ladder"));
}

TEST(PageData, NamesWhatEveryStepIsToldFrom) {
  const json words = DataOfPage(MissingEffectsReport())["words"];
  EXPECT_EQ(words["to_tell"][0], "To tell tip_radius from surface_offset");
}

TEST(PageData, GivesEveryProblemItsTitleAndItsCommandOverLines) {
  const json words = DataOfPage(CheckDataReport())["words"];
  ASSERT_EQ(words["problems"].size(), 2u);
  EXPECT_THAT(words["problems"][0]["title"].get<std::string>(), testing::Not(testing::IsEmpty()));
  EXPECT_THAT(words["problems"][0]["fix"].get<std::string>(), testing::HasSubstr("-o fixed.csv"));
}

TEST(PageData, HasTheTableOfTouchesAndTheJsonReportDoesNot) {
  v1::Report report = MissingEffectsReport();
  v1::TouchTable* table = report.mutable_data(0)->mutable_touch_table();
  table->add_touch(17);
  table->add_residual(std::nanf(""));
  const json data = DataOfPage(report)["report"]["data"][0];
  EXPECT_EQ(data["touch_table"]["touch"][0], "17");
  EXPECT_EQ(data["touch_table"]["residual"][0], "NaN");
  EXPECT_TRUE(data["surface_points"].empty()) << "the table has them";
  const json json_report = json::parse(*JsonReport(report));
  EXPECT_FALSE(json_report["data"][0].contains("touch_table"));
  EXPECT_FALSE(json_report["data"][0]["surface_points"].empty());
}

TEST(PageData, HasTheUncertaintyAtEveryContactByObject) {
  v1::Report report = MissingEffectsReport();
  EXPECT_TRUE(DataOfPage(report)["words"]["of_data"][0]["uncertainty"].empty());
  v1::SurfacePoint* point = report.mutable_data(0)->add_surface_points();
  point->set_object("cup");
  point->set_y_mm(-20.25);
  point->set_std_uncertainty(4100);
  EXPECT_EQ(DataOfPage(report)["words"]["of_data"][0]["uncertainty"]["cup"], json({0, -20.25, 0, 4100}));
}

TEST(PageData, OfAnEmptyReportSaysThatNothingWasCompared) {
  EXPECT_EQ(DataOfPage(v1::Report())["words"]["headline"], "Nothing could be compared.");
}

}  // namespace
}  // namespace touchstone::client
