#include "client/cli/diagnosis/rehearsal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/effects/all_effects.h"

namespace touchstone::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// A check of two effects: one that is found from 0.1 of its usual size, one that is never found.
v1::Report TwoEffects() {
  v1::Report check;
  v1::DetectableEffect* tip = check.add_detectable();
  tip->set_effect("tip_radius");
  tip->set_parameter("radius_mm");
  tip->set_typical(1.5);
  tip->set_found_from(0.15);
  tip->set_power_at_typical(1);
  v1::DetectableEffect* skew = check.add_detectable();
  skew->set_effect("clock_skew");
  skew->set_parameter("relative");
  skew->set_typical(0.001);
  skew->set_power_at_typical(0.12);
  return check;
}

std::vector<RehearsedCase> Cases(const HiddenSize& size = {}, int pairs = 0) {
  auto cases = ListCases(model::NominalModel(), TwoEffects(), size, {}, pairs, 1);
  EXPECT_TRUE(cases.ok()) << cases.status();
  return *std::move(cases);
}

std::vector<std::string> Names(const std::vector<RehearsedCase>& cases) {
  std::vector<std::string> names;
  for (const RehearsedCase& one : cases) names.push_back(one.name);
  return names;
}

// A report with one step that names this effect, of this value.
v1::Report Naming(const std::string& effect, double value, double std_error, double probability) {
  v1::Report report;
  report.set_verdict(v1::Report::MISSING_EFFECTS);
  v1::Step* step = report.add_steps();
  step->set_effect(effect);
  step->set_probability(probability);
  v1::ParameterValue* parameter = step->add_parameters();
  parameter->set_name(effects::Catalogue().Find(effect)->parameters[0].name);
  parameter->set_value(value);
  parameter->set_std_error(std_error);
  return report;
}

TEST(ListCases, HidesNothingEveryEffectAPairAStrangerAndAMistake) {
  EXPECT_THAT(Names(Cases()), ElementsAre("nothing", "tip_radius", "clock_skew", "outside", "mistake"));
  EXPECT_THAT(Names(Cases({}, 1)),
              ElementsAre("nothing", "tip_radius", "clock_skew", HasSubstr("+"), "outside", "mistake"));
}

TEST(ListCases, AtTheSizeThatIsFoundLeavesOutWhatNeverIs) {
  const std::vector<RehearsedCase> cases = Cases({1, true});
  EXPECT_THAT(Names(cases), ElementsAre("nothing", "tip_radius", "outside", "mistake"));
  EXPECT_EQ(cases[1].predicted, 0.8);
  EXPECT_NEAR(cases[1].model.effects[0].values[0], 0.15e-3, 1e-12);
}

TEST(ListCases, AnEffectThatTheCheckHasNotIsRefused) {
  EXPECT_THAT(
      std::string(
          ListCases(model::NominalModel(), TwoEffects(), {}, {"tip_radios"}, 0, 1).status().message()),
      HasSubstr("'tip_radios' is no effect"));
}

TEST(AssessSet, TheHiddenEffectAloneIsRightAndItsValueIsCompared) {
  const RehearsedSet set = Assess(Cases()[1], Naming("tip_radius", 1.6, 0.05, 0.99));
  EXPECT_TRUE(set.found && set.right && set.honest());
  EXPECT_THAT(set.z, ElementsAre(testing::DoubleNear(2, 1e-9)));
}

TEST(AssessSet, AnotherEffectIsAFalseClaimAndWithConfidenceIsConfidentlyWrong) {
  const RehearsedSet doubted = Assess(Cases()[1], Naming("gravity_sag", 0.5, 0.1, 0.6));
  EXPECT_TRUE(doubted.false_claim);
  EXPECT_FALSE(doubted.found || doubted.right || doubted.confident);
  EXPECT_TRUE(Assess(Cases()[1], Naming("gravity_sag", 0.5, 0.1, 0.95)).confident);
}

TEST(AssessSet, AnEquivalentCountsAsFound) {
  v1::Report report = Naming("object_scale", 0.01, 0.001, 0.9);
  report.mutable_steps(0)->add_equivalent("tip_radius");
  EXPECT_TRUE(Assess(Cases()[1], report).right);
}

TEST(AssessSet, OfNothingAnEmptyReportIsRight) {
  v1::Report adequate;
  adequate.set_verdict(v1::Report::ADEQUATE);
  EXPECT_TRUE(Assess(Cases()[0], adequate).right);
  EXPECT_FALSE(Assess(Cases()[1], adequate).right);
  EXPECT_TRUE(Assess(Cases()[1], adequate).honest());
  EXPECT_FALSE(Assess(Cases()[0], Naming("tip_radius", 1, 0.1, 0.99)).right);
}

TEST(AssessSet, OfNothingOnlyAdequateIsRight) {
  v1::Report report;
  for (const v1::Report::Verdict verdict : {v1::Report::UNEXPLAINED, v1::Report::WRONG_VALUES}) {
    report.set_verdict(verdict);
    EXPECT_FALSE(Assess(Cases()[0], report).right);
    EXPECT_TRUE(Assess(Cases()[0], report).false_claim);
  }
  report.set_verdict(v1::Report::TOO_LITTLE_DATA);
  EXPECT_FALSE(Assess(Cases()[0], report).right);
  EXPECT_TRUE(Assess(Cases()[0], report).honest());
}

TEST(AssessSet, UnexplainedIsAFalseClaimUnlessWhatIsHiddenHasNoName) {
  v1::Report report = Naming("tip_radius", 1.5, 0.05, 0.99);
  report.set_verdict(v1::Report::UNEXPLAINED);
  EXPECT_TRUE(Assess(Cases()[1], report).found);
  EXPECT_FALSE(Assess(Cases()[1], report).right);
  EXPECT_TRUE(Assess(Cases()[3], report).right);
}

TEST(AssessSet, CheckDataIsRightForAMistakeAndConfidentlyWrongElse) {
  v1::Report checks;
  checks.set_verdict(v1::Report::CHECK_DATA);
  EXPECT_TRUE(Assess(Cases()[4], checks).right);
  EXPECT_TRUE(Assess(Cases()[1], checks).confident);
}

TEST(RehearsalSummary, CountsWithIntervalsAndCoverage) {
  RehearsedSet hit{"tip_radius", true, true, false, false, {0.5}},
      miss{"tip_radius", false, false, false, false, {-3}};
  const std::vector<RehearsalRow> rows = Summarise(Cases(), {hit, hit, hit, miss});
  EXPECT_EQ(rows[1].found, 3);
  EXPECT_EQ(rows[1].covered, 3);
  EXPECT_NEAR(rows[1].mean_z, -0.375, 1e-12);
  EXPECT_EQ(rows.back().sets, 4);
  // Clopper and Pearson of 3 in 4.
  EXPECT_NEAR(IntervalOf(3, 4).lower, 0.194, 1e-3);
  EXPECT_NEAR(IntervalOf(3, 4).upper, 0.9937, 1e-3);
  EXPECT_EQ(IntervalOf(0, 4).lower, 0);
}

TEST(RehearsalSummary, ASetGoesThroughItsLine) {
  const RehearsedSet set{"a+b", true, false, true, true, {1.25, -2}};
  const RehearsedSet read = *SetFromJson(ToJson(set));
  EXPECT_EQ(ToJson(read), ToJson(set));
  EXPECT_THAT(std::string(SetFromJson(Json::parse("{\"case\": 3}")).status().message()),
              HasSubstr("no set of a rehearsal"));
}

}  // namespace
}  // namespace touchstone::cli
