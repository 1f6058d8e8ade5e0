// Right, honest and confidently wrong, of reports that were written by hand.
#include "tests/hidden_effects/score/figures.h"

#include <gtest/gtest.h>

#include <limits>
#include <optional>
#include <string>

namespace touchstone::hidden {
namespace {

v1::Report Says(v1::Report::Verdict verdict, double initial_us = 12'000, double final_us = 12'000) {
  v1::Report report;
  report.set_verdict(verdict);
  v1::DataReport* data = report.add_data();
  data->mutable_initial()->set_rmse(initial_us);
  data->mutable_final()->set_rmse(final_us);
  return report;
}

v1::Step* NameStep(v1::Report* report, const std::string& effect, double probability,
                   const std::vector<std::string>& equivalent = {}) {
  v1::Step* step = report->add_steps();
  step->set_effect(effect);
  step->set_probability(probability);
  for (const std::string& name : equivalent) step->add_equivalent(name);
  return step;
}

v1::Report UnexplainedBy(const std::string& covariate) {
  v1::Report report = Says(v1::Report::UNEXPLAINED);
  report.mutable_data(0)->mutable_unexplained()->add_covariates()->set_name(covariate);
  return report;
}

// The answers as letters: R right, H honest, W confidently wrong.
std::string Letters(const char* arm_name, const Scenario& truth, const v1::Report& report, Tried tried = {}) {
  const Arm& arm = *FindArm(arm_name);
  const auto marks = Judge(arm, truth, report, tried.formula_cuts_to);
  std::string letters;
  for (const Mark& mark : JudgeFigures(arm, truth, report, marks, tried)) {
    if (mark.measure == "right" && mark.yes) letters += 'R';
    if (mark.measure == "honest" && mark.yes) letters += 'H';
    if (mark.measure == "confidently wrong" && mark.yes) letters += 'W';
  }
  return letters;
}

std::optional<bool> FigureOf(const char* measure, const char* arm_name, const Scenario& truth,
                             const v1::Report& report, Tried tried = {}) {
  const Arm& arm = *FindArm(arm_name);
  for (const Mark& mark : JudgeFigures(arm, truth, report, Judge(arm, truth, report, NAN), tried))
    if (mark.measure == measure) return mark.yes;
  return std::nullopt;
}

Scenario Causing(Cause cause) {
  Scenario scenario;
  scenario.causes = {std::move(cause)};
  return scenario;
}

const Scenario& Wave() {
  static const auto* scenario = new Scenario(Causing({CauseKind::kSessionWave, 0.2, {1200, 0}, {1, 0, -1}}));
  return *scenario;
}

TEST(Figures, WhatDependsOnTimeIsRightAsUnexplainedWithTimeFirst) {
  const char* arm = "session wave, realistic";
  EXPECT_EQ(Letters(arm, Wave(), UnexplainedBy("session_time_s")), "RH");
  EXPECT_EQ(Letters(arm, Wave(), UnexplainedBy("touch")), "RH");
  EXPECT_EQ(Letters(arm, Wave(), UnexplainedBy("travel_mm")), "H");
  EXPECT_EQ(FigureOf("unexplained by time", arm, Wave(), UnexplainedBy("session_time_s")), true);
  EXPECT_EQ(FigureOf("unexplained by time", arm, Wave(), UnexplainedBy("travel_mm")), false);
}

TEST(Figures, AWrongNameIsConfidentAboveNineTenths) {
  v1::Report report = Says(v1::Report::MISSING_EFFECTS);
  v1::Step* step = NameStep(&report, "thermal_drift", 0.95);
  EXPECT_EQ(Letters("session wave, weak", Wave(), report), "W");
  step->set_probability(0.6);
  EXPECT_EQ(Letters("session wave, weak", Wave(), report), "H");
  // Beside an unexplained rest it is no better.
  v1::Report beside = UnexplainedBy("session_time_s");
  NameStep(&beside, "surface_error", 0.99);
  EXPECT_EQ(Letters("session wave, weak", Wave(), beside), "W");
}

TEST(Figures, NothingMissingIsHonestOfWeakCausesAndWrongOfStrongOnes) {
  for (const auto verdict : {v1::Report::ADEQUATE, v1::Report::WRONG_VALUES}) {
    EXPECT_EQ(Letters("session wave, weak", Wave(), Says(verdict)), "H");
    EXPECT_EQ(Letters("session wave, realistic", Wave(), Says(verdict)), "");
    EXPECT_EQ(Letters("session wave, strong", Wave(), Says(verdict)), "W");
  }
}

TEST(Figures, AFallMustBeFoundAgain) {
  v1::Report report = Says(v1::Report::MISSING_EFFECTS, 12'000, 5000);
  NameStep(&report, "object_push", 0.95);
  Scenario truth;
  truth.hidden = {{"object_push", {0.3}}};
  const double unreadable = std::numeric_limits<double>::infinity();
  EXPECT_EQ(Letters("one", truth, report, {5100, NAN, NAN}), "RH");
  EXPECT_EQ(Letters("one", truth, report, {5400, NAN, NAN}), "W");
  EXPECT_EQ(Letters("one", truth, report, {unreadable, NAN, NAN}), "W");
  EXPECT_EQ(Letters("one", truth, report, {NAN, NAN, NAN}), "W");
  EXPECT_TRUE(ClaimsAFall(report));
  EXPECT_FALSE(ClaimsAFall(Says(v1::Report::ADEQUATE, 5000, 4900)));
}

TEST(Figures, AnErrorIsAsClaimedWhereFreshTouchesLeaveItWithinATenth) {
  v1::Report report = Says(v1::Report::MISSING_EFFECTS, 12'000, 5000);
  report.mutable_data(0)->mutable_final()->set_heldout_rmse(5200);
  Scenario truth;
  truth.hidden = {{"object_push", {0.3}}};
  const auto as_claimed = [&](double fresh_us) {
    Tried tried;
    tried.final_found_us = 5000;
    tried.fresh_us = fresh_us;
    for (const Mark& mark : JudgeFigures(*FindArm("one"), truth, report, {}, tried))
      if (mark.measure == "error on fresh touches as claimed") return mark.yes;
    ADD_FAILURE() << "not marked";
    return false;
  };
  EXPECT_EQ(ClaimedErrorUs(report), 5200);
  EXPECT_TRUE(as_claimed(5700));
  EXPECT_FALSE(as_claimed(5750));
  EXPECT_FALSE(as_claimed(std::numeric_limits<double>::infinity()));
  EXPECT_FALSE(as_claimed(NAN)) << "nothing was tried";
}

TEST(Figures, AnEquivalentThatHoldsTheTruthIsHonest) {
  Scenario truth;
  truth.hidden = {{"tip_radius", {1}}};
  v1::Report report = Says(v1::Report::MISSING_EFFECTS);
  NameStep(&report, "oblique_slip", 0.97, {"tip_radius"});
  EXPECT_EQ(Letters("one", truth, report), "H");
  report.mutable_steps(0)->clear_equivalent();
  EXPECT_EQ(Letters("one", truth, report), "W");
}

TEST(Figures, OfNothingEveryClaimIsWrong) {
  EXPECT_EQ(Letters("nothing", {}, Says(v1::Report::ADEQUATE)), "RH");
  EXPECT_EQ(Letters("nothing", {}, UnexplainedBy("travel_mm")), "");
  EXPECT_EQ(Letters("nothing", {}, Says(v1::Report::WRONG_VALUES)), "W");
  EXPECT_EQ(Letters("nothing", {}, Says(v1::Report::CHECK_DATA)), "W");
  v1::Report named = Says(v1::Report::MISSING_EFFECTS);
  NameStep(&named, "surface_error", 0.95);
  EXPECT_EQ(Letters("nothing", {}, named), "W");
  EXPECT_EQ(Letters("bumps of 0.5 sigma", {}, named), "RH");
}

TEST(Figures, AnEffectOnOneObjectMustSaySo) {
  Scenario truth = Causing({CauseKind::kSlipOnOneObject, 0.5, {1}, {}});
  const Triangles none{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
  for (const char* name : {"lat00", "lat10"}) truth.objects.push_back(std::make_shared<Solid>(name, none));
  v1::Report report = Says(v1::Report::MISSING_EFFECTS);
  v1::Step* step = NameStep(&report, "oblique_slip", 0.95);
  const char* arm = "slip on one object, realistic";
  EXPECT_EQ(Letters(arm, truth, report), "H");
  step->set_words("on lat00 only");
  EXPECT_EQ(Letters(arm, truth, report), "H");
  step->set_words("on lat10 only");
  EXPECT_EQ(Letters(arm, truth, report), "RH");
  EXPECT_EQ(Letters(arm, truth, UnexplainedBy("object")), "RH");
}

TEST(Figures, ErrorsOfEachPoseHaveNoCovariate) {
  const Scenario truth = Causing({CauseKind::kPoseError, 0.1, {}, {}});
  const char* arm = "error of each pose, realistic";
  EXPECT_EQ(Letters(arm, truth, Says(v1::Report::UNEXPLAINED)), "RH");
  EXPECT_EQ(Letters(arm, truth, UnexplainedBy("curvature_per_m")), "H");
}

TEST(Figures, AMistakeInTheFileIsRightByItsKind) {
  Scenario truth;
  truth.data_errors = {{DataErrorKind::kFingersPermuted, 0, {1, 0, 2}}};
  v1::Report report = Says(v1::Report::CHECK_DATA);
  report.add_data_problems()->set_kind(v1::DataProblem::FINGER_ORDER);
  EXPECT_EQ(Letters("fingers permuted, strong", truth, report), "RH");
  report.mutable_data_problems(0)->set_kind(v1::DataProblem::ROW_SHIFT);
  EXPECT_EQ(Letters("fingers permuted, strong", truth, report), "W");
  v1::Report physics = Says(v1::Report::MISSING_EFFECTS);
  NameStep(&physics, "tool_yaw", 0.99);
  EXPECT_EQ(Letters("fingers permuted, strong", truth, physics), "W");
  EXPECT_EQ(Letters("fingers permuted, strong", truth, Says(v1::Report::UNEXPLAINED)), "H");
}

TEST(Figures, OldValuesCompeteWithNewEffects) {
  Scenario truth;
  truth.in_model = {{"finger_length", {0.3, 0, -0.3}}}, truth.hidden = {{"finger_length", {0.5, 0, -0.5}}};
  const char* arm = "old value wrong, strong";
  v1::Report tilt = Says(v1::Report::MISSING_EFFECTS);
  v1::Step* step = NameStep(&tilt, "tool_tilt", 0.98);
  EXPECT_EQ(Letters(arm, truth, tilt), "W");
  step->add_equivalent("channel_latency");
  EXPECT_EQ(Letters(arm, truth, tilt), "W");
  step->add_equivalent("given:finger_length");
  EXPECT_EQ(Letters(arm, truth, tilt), "RH");
  v1::Report values = Says(v1::Report::WRONG_VALUES);
  v1::Refit* refit = values.add_refitted();
  refit->set_effect("finger_length");
  for (const double mm : {0.501, 0.0, -0.499}) {
    v1::ParameterValue* value = refit->add_parameters();
    value->set_value(mm), value->set_std_error(0.001);
  }
  EXPECT_EQ(Letters(arm, truth, values), "RH");
  refit->mutable_parameters(0)->set_value(0.3);
  EXPECT_EQ(Letters(arm, truth, values), "W");
}

TEST(Figures, AValueBeyondItsBoundIsTheEffectWithThatValueAlone) {
  Scenario truth;
  truth.hidden = {{"object_push", {8}}};
  const char* arm = "beyond its bound, realistic";
  v1::Report report = Says(v1::Report::MISSING_EFFECTS);
  v1::ParameterValue* value = NameStep(&report, "object_push", 0.95)->add_parameters();
  value->set_value(8.1), value->set_std_error(0.01);
  EXPECT_EQ(Letters(arm, truth, report), "RH");
  value->set_value(4.99);
  EXPECT_EQ(Letters(arm, truth, report), "H");
  NameStep(&report, "surface_error", 0.95);
  EXPECT_EQ(Letters(arm, truth, report), "W");
}

TEST(Figures, ABadPrintIsNamedOrOwnedUpWithoutAFallThatNobodyGetsAgain) {
  Scenario truth;
  truth.hidden = {{"surface_error", {0.4, 20}}};
  const char* arm = "bad print, strong";
  v1::Report report = Says(v1::Report::MISSING_EFFECTS);
  NameStep(&report, "surface_map", 0.95);
  EXPECT_EQ(Letters(arm, truth, report), "RH");
  EXPECT_EQ(Letters(arm, truth, Says(v1::Report::UNEXPLAINED)), "RH");
  report.mutable_data(0)->mutable_final()->set_rmse(5000);
  EXPECT_EQ(Letters(arm, truth, report, {12'000, NAN, NAN}), "W");
}

TEST(Figures, NoiseThatIsNotThereMustBeSaid) {
  Scenario truth;
  truth.in_model = {{"poll_interval", {25'000}}};
  const char* arm = "polling that is not there, strong";
  EXPECT_EQ(Letters(arm, truth, Says(v1::Report::ADEQUATE)), "W");
  v1::Report said = Says(v1::Report::ADEQUATE);
  said.add_superfluous("poll_interval");
  EXPECT_EQ(Letters(arm, truth, said), "RH");
}

TEST(Figures, OfTooFewTouchesOnlyThatCanBeSaid) {
  EXPECT_EQ(Letters("6 touches, strong", {}, Says(v1::Report::TOO_LITTLE_DATA)), "RH");
  EXPECT_EQ(Letters("6 touches, strong", {}, Says(v1::Report::ADEQUATE)), "W");
  EXPECT_EQ(Letters("6 touches, weak", {}, Says(v1::Report::ADEQUATE)), "H");
}

TEST(Figures, ClaimsOfNearCertaintyAreCountedOneByOne) {
  v1::Report report = Says(v1::Report::MISSING_EFFECTS);
  NameStep(&report, "thermal_drift", 0.995);
  EXPECT_EQ(FigureOf("claim beyond 0.99 right", "session wave, weak", Wave(), report), false);
  EXPECT_EQ(FigureOf("probability of 1", "session wave, weak", Wave(), report), false);
  report.mutable_steps(0)->set_probability(0.98);
  EXPECT_EQ(FigureOf("claim beyond 0.99 right", "session wave, weak", Wave(), report), std::nullopt);
  report.mutable_steps(0)->set_probability(1);
  EXPECT_EQ(FigureOf("probability of 1", "session wave, weak", Wave(), report), true);
}

TEST(Figures, ACurveMustHalveTheMisfitWhereThereIsOne) {
  const v1::Report report = UnexplainedBy("session_time_s");
  const char* measure = "lookup halves the misfit";
  EXPECT_EQ(FigureOf(measure, "session wave, weak", Wave(), report, {NAN, NAN, 0.3}), true);
  EXPECT_EQ(FigureOf(measure, "session wave, weak", Wave(), report, {NAN, NAN, 0.7}), false);
  EXPECT_EQ(FigureOf(measure, "session wave, weak", Wave(), report), false);
  // Nobody can predict a walk.
  EXPECT_EQ(FigureOf(measure, "random walk, weak", Causing({CauseKind::kRandomWalk, 5000, {}, {}}), report),
            std::nullopt);
}

}  // namespace
}  // namespace touchstone::hidden
