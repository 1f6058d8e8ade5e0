#include <algorithm>
#include <cmath>
#include <regex>
#include <set>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "client/report/html_page.h"
#include "client/report/occurrences.h"
#include "client/report/report.h"
#include "client/report/sample_reports.h"
#include "client/report/svg_chart.h"
#include "client/report/svg_object.h"

namespace touchstone::client {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(Escape, LeavesNoMarkup) {
  EXPECT_EQ(Escape("<b a=\"1\" c='2'>&\x01"), "&lt;b a=&quot;1&quot; c=&#39;2&#39;&gt;&amp;\\x01");
}

TEST(Typeset, SetsNumbersInType) {
  EXPECT_EQ(Typeset("-3.1 +- 0.2 us"), "\u22123.1\u00a0\u00b1\u00a00.2\u00a0\u00b5s");
  EXPECT_EQ(Typeset("+- 0.2 us"), "\u00b1\u00a00.2\u00a0\u00b5s");
  EXPECT_EQ(Typeset("p 3e-9"), "p 3\u00d710<sup>\u22129</sup>");
  EXPECT_EQ(Typeset("41.0 -> 5.0 ms"), "41.0 \u2192 5.0\u00a0ms");
  EXPECT_EQ(Typeset("25 deg"), "25\u00b0");
}

TEST(Typeset, LeavesNamesAlone) {
  EXPECT_EQ(Typeset("lat-10 and cov_us_2 s3e"), "lat-10 and cov_us_2 s3e");
}

TEST(HtmlReport, EscapesWhatUsersNamed) {
  const std::string evil = "</script><script>alert('x')</script>\"";
  v1::Report report = MissingEffectsReport();
  report.set_model_name(evil);
  report.set_summary(evil);
  report.set_version(evil);
  report.set_model_hash(evil);
  report.set_improved_model_yaml(evil);
  report.add_warnings(evil);
  report.mutable_data(0)->mutable_set()->set_objects(0, evil);
  report.mutable_data(0)->set_session(evil);
  report.mutable_data(0)->mutable_set_aside()->mutable_rows(0)->set_reason(evil);
  for (auto& point : *report.mutable_data(0)->mutable_surface_points()) point.set_object(evil);
  for (auto& outline : *report.mutable_data(0)->mutable_outlines()) outline.set_object(evil);
  for (auto& touch : *report.mutable_data(0)->mutable_worst_touches()) touch.set_object(evil);
  for (auto& touch : *report.mutable_next()) touch.set_object(evil);
  for (auto& group : *report.mutable_data(0)->mutable_groups()) group.set_name(evil);
  for (auto& histogram : *report.mutable_data(0)->mutable_histograms()) histogram.set_object(evil);
  for (auto& finger : *report.mutable_data(0)->mutable_fingers()) finger = evil;
  for (auto& slice : *report.mutable_data(0)->mutable_where()) slice.set_slice(evil);
  for (auto& curve : *report.mutable_data(0)->mutable_curves()) curve.set_covariate(evil);
  for (auto& step : *report.mutable_steps()) {
    step.set_effect(evil);
    step.set_meaning(evil);
    step.mutable_parameters(0)->set_name(evil);
    step.mutable_parameters(0)->set_unit(evil);
  }
  for (auto& candidate : *report.mutable_data(0)->mutable_candidates()) candidate.set_note(evil);
  const std::string html = HtmlReport(report);
  EXPECT_EQ(Occurrences(html, "<script>alert"), 0);
  EXPECT_EQ(Occurrences(html, "<script>"), 1) << "the page's own";
  // One script of data, one of code, each closed once.
  EXPECT_EQ(Occurrences(html, "</script>"), 2);
  const size_t data = html.find('{', html.find("id=\"objects-data\""));
  const auto json = nlohmann::json::parse(html.substr(data, html.find("</script>", data) - data));
  EXPECT_EQ(json["objects"][0]["name"], evil);
}

TEST(HtmlReport, HasEverySectionWhoseDataAreThere) {
  const std::string html = HtmlReport(MissingEffectsReport());
  for (const char* id : {"todo", "why", "where", "objects", "fit", "next", "data", "methods"}) {
    EXPECT_EQ(Occurrences(html, absl::StrCat("<section id=\"", id, "\"")), 1) << id;
  }
  EXPECT_EQ(Occurrences(HtmlReport(UnexplainedReport()), "<section id=\"unexplained\""), 1);
  EXPECT_EQ(Occurrences(HtmlReport(WithoutPosesReport()), "<section id=\"distributions\""), 1);
}

TEST(HtmlReport, ShowsMistakesOfTheFileWithTheirEvidenceAndTheCommand) {
  const std::string page = HtmlReport(CheckDataReport());
  EXPECT_EQ(Occurrences(page, "<section id=\"check\""), 1);
  EXPECT_EQ(Occurrences(page, "CHECK_DATA</span>"), 1);
  EXPECT_EQ(Occurrences(page, "--reverse-lateral -o fixed.csv</pre>"), 1);
  EXPECT_EQ(Occurrences(HtmlReport(AdequateReport()), "<section id=\"check\""), 0);
}

TEST(HtmlReport, DrawsACurveWithoutANameWithItsKnots) {
  v1::Report report = UnexplainedReport();
  v1::Unexplained& rest = *report.mutable_data(0)->mutable_unexplained();
  rest.clear_formula();
  rest.clear_formula_yaml();
  rest.set_lookup_yaml("- lookup: {name: rest_session_time_s}\n");
  rest.set_nearest_formula("k * session_time_s");
  rest.set_nearest_formula_share(0.84);
  v1::UnexplainedCurve& curve = *rest.mutable_curve();
  curve.set_covariate("session_time_s");
  curve.set_covariate_unit("s");
  curve.set_unit("mm");
  for (const double knot : {0, 100, 200, 300}) curve.add_knots(knot);
  for (const char* finger : {"l", "m"}) {
    curve.add_curves()->set_finger(finger);
    for (const double value : {0.0, 0.1, 0.2, 0.1})
      curve.mutable_curves(curve.curves_size() - 1)->add_values(value);
  }
  const std::string page = HtmlReport(report);
  EXPECT_EQ(Occurrences(page, "class=\"dots knots f"), 2);
  EXPECT_EQ(Occurrences(page, "The curve over session time (s)"), 1);
  EXPECT_EQ(Occurrences(page, "added travel (mm)"), 1);
  EXPECT_EQ(Occurrences(page, "k * session_time_s</code>, with 84"), 1);
  EXPECT_EQ(Occurrences(page, "rest_session_time_s}"), 1);
}

TEST(HtmlReport, SaysHowToMakeItAgain) {
  v1::Report report = AdequateReport();
  EXPECT_EQ(Occurrences(HtmlReport(report), "<section id=\"provenance\""), 0);
  v1::Provenance& provenance = *report.mutable_provenance();
  provenance.set_command("touchstone diagnose 'my <set>.csv'");
  provenance.set_set_sha256(std::string(64, 'a'));
  provenance.set_date("2031-05-06T07:08:09Z");
  provenance.add_meshes()->set_object("cup");
  provenance.mutable_meshes(0)->set_mesh_hash(std::string(64, 'b'));
  const std::string page = HtmlReport(report);
  EXPECT_EQ(Occurrences(page, "touchstone diagnose &#39;my &lt;set&gt;.csv&#39;</pre>"), 1);
  for (const std::string& hash : {std::string(64, 'a'), std::string(64, 'b')})
    EXPECT_EQ(Occurrences(page, absl::StrCat("title=\"", hash, "\"")), 1);
  EXPECT_EQ(Occurrences(page, "2031-05-06T07:08:09Z"), 1);
}

TEST(HtmlReport, TestsEachFingerAgainstThePlaceInTheSession) {
  v1::Report report = MissingEffectsReport();
  for (v1::CovariateCurve& curve : *report.mutable_data(0)->mutable_curves())
    curve.set_p(1), curve.set_p_after(1);
  v1::FingerDependence* finger = report.mutable_data(0)->mutable_curves(0)->add_fingers();
  finger->set_finger("m");
  finger->set_p(3e-9);
  finger->set_p_after(0.4);
  EXPECT_EQ(Occurrences(HtmlReport(report), "finger m p 3\u00d710<sup>\u22129</sup> given, 0.40 improved"),
            1);
}

TEST(HtmlReport, SaysWhichObjectACandidateWasTriedAt) {
  v1::Report report = MissingEffectsReport();
  v1::Candidate* candidate = report.mutable_data(0)->mutable_candidates(0);
  candidate->mutable_scope()->set_kind(v1::Scope::OBJECT);
  candidate->mutable_scope()->add_objects("lat10");
  EXPECT_THAT(HtmlReport(report), HasSubstr("of lat10 only"));
  candidate->mutable_scope()->add_objects("lat20");
  EXPECT_THAT(HtmlReport(report), HasSubstr("a value per object"));
}

TEST(HtmlReport, OfBothKindsRanksCandidatesWithWhatBothShowInPlace) {
  v1::Report report = MissingEffectsReport();
  EXPECT_THAT(HtmlReport(report), HasSubstr("as the first to be added"));
  v1::DataReport* photographs = report.add_data();
  photographs->set_kind(v1::DataReport::PHOTOGRAPHS);
  photographs->set_unit("grey");
  photographs->set_count(20);
  photographs->mutable_initial()->set_rmse(6.5);
  photographs->mutable_final()->set_rmse(1.4);
  report.mutable_steps(0)->set_effect("object_pose");
  report.mutable_steps(0)->add_shown_by(v1::DataReport::TOUCHES);
  report.mutable_steps(0)->add_shown_by(v1::DataReport::PHOTOGRAPHS);
  v1::Candidate* tilt = report.mutable_data(0)->mutable_candidates(0);
  tilt->set_rmse(3210), tilt->set_heldout_rmse(3210);
  const std::string html = HtmlReport(report);
  EXPECT_THAT(html, HasSubstr("with object_pose in place"));
  EXPECT_THAT(html, HasSubstr(Typeset("3.21 ms")));
  // Each kind under its name, with errors in its unit.
  EXPECT_THAT(html, HasSubstr("<h3>Touches</h3>"));
  EXPECT_THAT(html, HasSubstr("6.50 grey"));
}

TEST(HtmlReport, LeavesOutSectionsWithoutData) {
  const std::string html = HtmlReport(v1::Report());
  EXPECT_EQ(Occurrences(html, "<section"), 0);
  EXPECT_GE(Occurrences(html, "Nothing could be compared."), 1);
  EXPECT_EQ(Occurrences(HtmlReport(AdequateReport()), "<section id=\"todo\""), 0);
}

TEST(HtmlReport, SaysTheVerdictFirstAndOnce) {
  for (const NamedReport& sample : AllSampleReports()) {
    const std::string html = HtmlReport(sample.report);
    EXPECT_EQ(Occurrences(html, "<h1>"), 1) << sample.name;
    const size_t section = html.find("<section");
    if (section != std::string::npos) {
      EXPECT_LT(html.find("<h1>"), section) << sample.name;
    }
  }
}

TEST(HtmlReport, SaysWarningsOnce) {
  v1::Report report = MissingEffectsReport();
  report.add_warnings("A warning like no other.");
  const std::string html = HtmlReport(report);
  EXPECT_EQ(Occurrences(html, "A warning like no other."), 1);
  EXPECT_EQ(Occurrences(html, report.steps(0).check_on_rig().substr(0, 20)), 1);
  EXPECT_EQ(Occurrences(html, "33</td>"), 1) << "rows not used";
}

TEST(HtmlReport, ShowsTheSummaryWhereNoPartSaysTheSame) {
  v1::Report report = WithoutPosesReport();
  report.set_summary("A summary like no other.");
  EXPECT_EQ(Occurrences(HtmlReport(report), "A summary like no other."), 1);
  *report.mutable_data(0)->mutable_initial() = MissingEffectsReport().data(0).initial();
  EXPECT_EQ(Occurrences(HtmlReport(report), "A summary like no other."), 0);
}

TEST(HtmlReport, HasNoIdTwice) {
  for (const NamedReport& sample : AllSampleReports()) {
    const std::string html = HtmlReport(sample.report);
    std::set<std::string> ids;
    const std::regex id(" id=\"([^\"]*)\"");
    for (std::sregex_iterator it(html.begin(), html.end(), id), end; it != end; ++it) {
      EXPECT_TRUE(ids.insert((*it)[1]).second) << sample.name << " " << (*it)[1];
    }
  }
}

TEST(HtmlReport, FetchesNothing) {
  for (const NamedReport& sample : AllSampleReports()) {
    const std::string html = HtmlReport(sample.report);
    for (const char* trace : {"http://", "https://", "src=", "url(", "@import", "<link", "<img"}) {
      EXPECT_EQ(Occurrences(html, trace), 0) << sample.name;
    }
  }
}

TEST(HtmlReport, IsSmallerThanAMegabyteAndAHalfFor960Touches) {
  EXPECT_LT(HtmlReport(MissingEffectsReport()).size(), 1500000u);
}

TEST(HtmlReport, ThinsPointsOfLargeSets) {
  v1::Report report = CompareReport();
  for (int i = 0; i < 6; ++i) {
    report.mutable_data(0)->mutable_surface_points()->MergeFrom(CompareReport().data(0).surface_points());
    report.mutable_data(0)->mutable_parity()->MergeFrom(CompareReport().data(0).parity());
  }
  const std::string html = HtmlReport(report);
  EXPECT_LT(html.size(), 1500000u);
  EXPECT_GE(Occurrences(html, " of 20 160 contacts are drawn"), 1);
}

TEST(HtmlReport, ClosesEveryElementItOpens) {
  for (const NamedReport& sample : AllSampleReports()) {
    const std::string html = HtmlReport(sample.report);
    for (const char* tag : {"section", "figure", "table", "tbody", "thead", "tr",     "td",   "th",     "div",
                            "svg",     "g",      "dl",    "dt",    "dd",    "ol",     "ul",   "li",     "p",
                            "span",    "pre",    "h2",    "h3",    "h4",    "button", "text", "details"}) {
      EXPECT_EQ(
          Occurrences(html, absl::StrCat("<", tag, " ")) + Occurrences(html, absl::StrCat("<", tag, ">")),
          Occurrences(html, absl::StrCat("</", tag, ">")))
          << tag << " in " << sample.name;
    }
  }
}

TEST(HtmlReport, ShowsNoNanAsANumber) {
  v1::Report report = MissingEffectsReport();
  const double nan = std::nan("");
  report.mutable_data(0)->mutable_initial()->set_lack_of_fit_p(nan);
  report.mutable_data(0)->mutable_initial()->set_heldout_rmse(nan);
  report.mutable_steps(0)->mutable_parameters(0)->set_std_error(nan);
  report.mutable_steps(0)->mutable_parameters(0)->set_lower(nan);
  report.mutable_data(0)->mutable_parity(0)->set_measured(nan);
  report.mutable_data(0)->mutable_surface_points(0)->set_after(nan);
  report.mutable_data(0)->mutable_surface_points(1)->set_x_mm(nan);
  report.mutable_data(0)->mutable_curves(0)->mutable_bins(0)->set_mean_residual(nan);
  report.mutable_data(0)->mutable_histograms(0)->set_measured(0, nan);
  const std::string html = HtmlReport(report);
  for (const char* word : {" nan", ">nan", "\"nan", "-nan", "Lnan", "Mnan", "Vnan", "NaN", "inf "}) {
    EXPECT_EQ(Occurrences(html, word), 0) << word;
  }
}

TEST(HtmlReport, GivesEveryPictureATextAlternative) {
  const std::string html = HtmlReport(MissingEffectsReport());
  const std::regex svg("<svg [^>]*>");
  for (std::sregex_iterator it(html.begin(), html.end(), svg), end; it != end; ++it) {
    const std::string tag = it->str();
    EXPECT_TRUE(absl::StrContains(tag, "aria-label=\"") || absl::StrContains(tag, "aria-hidden")) << tag;
  }
}

TEST(Bar, IsAsLongAsItsShare) {
  EXPECT_THAT(Bar(0.25, "given"), HasSubstr("width=\"25.00%\""));
  EXPECT_THAT(Bar(7, "given"), HasSubstr("width=\"100.00%\""));
  EXPECT_THAT(Bar(std::nan(""), "given"), HasSubstr("width=\"0.00%\""));
}

TEST(HtmlReport, LadderBarsAreProportionalToTheErrors) {
  v1::Report report = MissingEffectsReport();
  report.mutable_data(0)->mutable_initial()->set_rmse(40000);
  report.mutable_data(0)->mutable_after_step(0)->set_rmse(10000);
  const std::string html = HtmlReport(report);
  const std::string ladder = html.substr(html.find("class=\"ladder\""), 2500);
  EXPECT_THAT(ladder, HasSubstr("fill given\" height=\"100%\" width=\"100.00%\""));
  EXPECT_THAT(ladder, HasSubstr("fill better\" height=\"100%\" width=\"25.00%\""));
}

TEST(Ticks, AreRoundAndWithinTheRange) {
  EXPECT_THAT(Ticks({-1.3, 4.2}, 5), testing::ElementsAre(0, 2, 4));
  EXPECT_THAT(Ticks({0, 100}, 5), testing::ElementsAre(0, 20, 40, 60, 80, 100));
  EXPECT_THAT(Ticks({3, 3}, 5), testing::IsEmpty());
}

// A square in the plane z = 0, 20 mm wide, seen from above or below.
v1::ObjectOutline Plate() {
  v1::ObjectOutline plate;
  for (const float x : {-10, -10, 0, 10, -10, 0, 10, 10, 0, -10, 10, 0}) plate.add_vertices_mm(x);
  for (const uint32_t corner : {0, 1, 2, 0, 2, 3}) plate.add_triangles(corner);
  return plate;
}

TEST(ObjectPicture, HidesWhatIsBehind) {
  const ObjectPicture picture(Plate(), {});
  const View above = {0, 80}, below = {0, -80};
  EXPECT_TRUE(picture.Visible(above, {0, 0, 5}));
  EXPECT_FALSE(picture.Visible(below, {0, 0, 5}));
  EXPECT_TRUE(picture.Visible(below, {0, 0, 0})) << "a point on the surface is not hidden by it";
}

TEST(ObjectPicture, FindsWhereALineHits) {
  const ObjectPicture picture(Plate(), {});
  Vector hit;
  ASSERT_TRUE(picture.Hit({1, 2, 30}, {0, 0, -1}, &hit));
  EXPECT_THAT(hit, testing::ElementsAre(1, 2, 0));
  EXPECT_FALSE(picture.Hit({30, 2, 30}, {0, 0, -1}, &hit));
}

TEST(ObjectPicture, KeepsEverythingWithinThePicture) {
  const ObjectPicture picture(Plate(), {});
  for (const Vector& corner : {Vector{-10, -10, 0}, Vector{10, -10, 0}, Vector{10, 10, 0}}) {
    const auto p = picture.Project(kFrontView, corner);
    EXPECT_GE(std::min(p.x, p.y), 0);
    EXPECT_LE(std::max(p.x, p.y), ObjectPicture::kSide);
  }
}

TEST(ObjectPicture, ToleratesBrokenOutlines) {
  v1::ObjectOutline broken = Plate();
  broken.add_triangles(0);
  broken.add_triangles(99);
  broken.add_triangles(1);
  broken.set_vertices_mm(0, std::nanf(""));
  EXPECT_THAT(ObjectPicture(broken, {}).Faces(kFrontView), Not(HasSubstr("nan")));
  EXPECT_EQ(ObjectPicture(v1::ObjectOutline(), {}).Faces(kFrontView), "");
}

}  // namespace
}  // namespace touchstone::client
