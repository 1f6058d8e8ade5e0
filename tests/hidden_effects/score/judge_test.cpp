// The marks of reports that were written by hand.
#include "tests/hidden_effects/score/judge.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

namespace touchstone::hidden {
namespace {

Scenario Hiding(std::vector<Hidden> hidden) {
  Scenario scenario;
  scenario.hidden = std::move(hidden);
  return scenario;
}

v1::Step* AddStep(v1::Report* report, const std::string& effect, std::vector<std::string> equivalent = {}) {
  report->set_verdict(v1::Report::MISSING_EFFECTS);
  v1::Step* step = report->add_steps();
  step->set_effect(effect);
  for (const std::string& name : equivalent) step->add_equivalent(name);
  return step;
}

void AddValue(v1::Step* step, const std::string& name, double value, double std_error,
              const std::string& finger = "") {
  v1::ParameterValue* parameter = step->add_parameters();
  parameter->set_name(name), parameter->set_value(value), parameter->set_std_error(std_error);
  parameter->set_lower(value - 2 * std_error), parameter->set_upper(value + 2 * std_error);
  parameter->set_finger(finger);
}

std::optional<bool> Ask(const char* measure, const std::vector<Mark>& marks) {
  std::optional<bool> answer;
  for (const Mark& mark : marks)
    if (mark.measure == measure) answer = mark.yes;
  return answer;
}

const Arm& One() {
  return *FindArm("one");
}

TEST(Judge, AnythingNamedWhereNothingIsHiddenIsAFalseClaim) {
  v1::Report report;
  report.set_verdict(v1::Report::ADEQUATE);
  EXPECT_EQ(Ask("false claim", Judge(*FindArm("nothing"), {}, report, NAN)), false);
  report.set_verdict(v1::Report::UNEXPLAINED);
  EXPECT_EQ(Ask("false claim", Judge(*FindArm("nothing"), {}, report, NAN)), true);
  v1::Report bumps, radius;
  AddStep(&bumps, "surface_error");
  AddStep(&radius, "tip_radius");
  EXPECT_EQ(Ask("false claim", Judge(*FindArm("nothing"), {}, bumps, NAN)), true);
  const Scenario bumpy = Hiding({{"surface_error", {0.05, 20}}});
  EXPECT_EQ(Ask("false claim", Judge(*FindArm("bumps of 0.5 sigma"), bumpy, bumps, NAN)), false);
  EXPECT_EQ(Ask("false claim", Judge(*FindArm("bumps of 0.5 sigma"), bumpy, radius, NAN)), true);
}

TEST(Judge, TheTruthIsRightByItsNameOrAsAnEquivalentOfItsOwnClass) {
  v1::Report report;
  AddStep(&report, "oblique_slip");
  EXPECT_EQ(Ask("right first", Judge(One(), Hiding({{"oblique_slip", {0.3}}}), report, NAN)), true);
  EXPECT_EQ(Ask("right first", Judge(One(), Hiding({{"tip_radius", {2}}}), report, NAN)), false);
  // "Radius or slip" names the truth, but is not right: data can distinguish the two.
  v1::Report either;
  AddStep(&either, "oblique_slip", {"tip_radius"});
  EXPECT_EQ(Ask("right first", Judge(One(), Hiding({{"tip_radius", {2}}}), either, NAN)), false);
  EXPECT_EQ(Ask("truth named", Judge(One(), Hiding({{"tip_radius", {2}}}), either, NAN)), true);
  // Exact equivalents: right if the report says so.
  v1::Report clock, clock_alone;
  AddStep(&clock, "clock_skew", {"speed_error", "contact_slowdown"});
  AddStep(&clock_alone, "clock_skew");
  EXPECT_EQ(Ask("right first", Judge(One(), Hiding({{"speed_error", {-0.02}}}), clock, NAN)), true);
  EXPECT_EQ(Ask("right first", Judge(One(), Hiding({{"speed_error", {-0.02}}}), clock_alone, NAN)), false);
}

TEST(Judge, SeveralEffectsMustAllBeFoundAndNothingAdded) {
  const Scenario truth = Hiding({{"oblique_slip", {0.3}}, {"object_push", {0.2}}});
  v1::Report report;
  AddStep(&report, "object_push");
  EXPECT_EQ(Ask("all found, none added", Judge(One(), truth, report, NAN)), false);
  AddStep(&report, "oblique_slip");
  EXPECT_EQ(Ask("all found, none added", Judge(One(), truth, report, NAN)), true);
  AddStep(&report, "tool_yaw");
  EXPECT_EQ(Ask("all found, none added", Judge(One(), truth, report, NAN)), false);
  EXPECT_EQ(Ask("none added", Judge(One(), truth, report, NAN)), false);
}

TEST(Judge, ValuesAreComparedInTheirUnitsFingerByFinger) {
  const Scenario truth = Hiding({{"finger_length", {0.2, -0.3, 0.1}}});
  v1::Report report;
  v1::Step* step = AddStep(&report, "finger_length", {"channel_latency"});
  AddValue(step, "offset_mm", 0.21, 0.01, "l");
  AddValue(step, "offset_mm", -0.32, 0.01, "m");
  AddValue(step, "offset_mm", 0.11, 0.01, "r");
  EXPECT_EQ(Ask("within 3 standard errors", Judge(One(), truth, report, NAN)), true);
  step->mutable_parameters(2)->set_value(0.15);
  EXPECT_EQ(Ask("within 3 standard errors", Judge(One(), truth, report, NAN)), false);
  step->mutable_parameters(2)->set_upper(0.05);
  EXPECT_EQ(Ask("interval covers", Judge(One(), truth, report, NAN)), false);
}

TEST(Judge, WhatDataCannotTellMustBeNamedTogetherWithWhatDecides) {
  const Arm& arm = *FindArm("latency or length, one speed");
  const Scenario truth = Hiding({{"channel_latency", {1000, -2000, 1000}}});
  v1::Report report;
  v1::Step* step = AddStep(&report, "finger_length", {"channel_latency"});
  EXPECT_EQ(Ask("said so", Judge(arm, truth, report, NAN)), true);
  EXPECT_EQ(Ask("said so, with what decides", Judge(arm, truth, report, NAN)), false);
  step->set_discriminating_measurement("a second speed");
  EXPECT_EQ(Ask("said so, with what decides", Judge(arm, truth, report, NAN)), true);
  step->clear_equivalent();
  EXPECT_EQ(Ask("said so", Judge(arm, truth, report, NAN)), false);
}

TEST(Judge, UnlistedPhysicsMustBeOwnedUp) {
  const Arm& arm = *FindArm("unlisted");
  Scenario truth;
  truth.unlisted = {{"lead_screw", 0.2, 4}};
  v1::Report report;
  report.set_verdict(v1::Report::UNEXPLAINED);
  report.add_data()->mutable_unexplained()->add_covariates()->set_name("travel_mm");
  auto marks = Judge(arm, truth, report, 0.3);
  EXPECT_EQ(Ask("unexplained", marks), true);
  EXPECT_EQ(Ask("right covariate first", marks), true);
  EXPECT_EQ(Ask("formula halves the misfit", marks), true);
  EXPECT_EQ(Ask("wrong name instead", marks), false);
  v1::Report wrong;
  AddStep(&wrong, "tool_yaw");
  marks = Judge(arm, truth, wrong, NAN);
  EXPECT_EQ(Ask("wrong name instead", marks), true);
  EXPECT_EQ(Ask("formula halves the misfit", marks), false);
}

TEST(Judge, WithoutPosesTheDifferenceIsFoundAndNobodyIsBlamed) {
  v1::Report report;
  report.add_data()->mutable_distributions()->set_p(0.001);
  const auto marks = Judge(*FindArm("no poses"), Hiding({{"tip_radius", {2}}}), report, NAN);
  EXPECT_EQ(Ask("detects", marks), true);
  EXPECT_EQ(Ask("names a culprit", marks), false);
}

}  // namespace
}  // namespace touchstone::hidden
