// Sets with known truth by a third simulation, which shares no code with the product or with the oracle here.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "server/base/test_paths.h"
#include "server/effects/all_effects.h"
#include "tests/hidden_effects/score/arms/test_objects.h"
#include "tests/hidden_effects/score/judge.h"

namespace touchstone::hidden {
namespace {

using testing::Contains;

const std::string kFolder = SharedData() + "/measurements/";

class PublicSets : public testing::Test {
 protected:
  static void SetUpTestSuite() { objects_ = new TestObjects(LoadTestObjects(kFolder)); }
  static void TearDownTestSuite() { delete objects_; }

  v1::Report Diagnosed(const std::string& file) {
    auto set = session::ReadMeasurementSet(kFolder + file);
    EXPECT_TRUE(set.ok()) << set.status();
    auto model = model::ParseModel(
        "touchstone: model/1\nname: nominal\nend_effector: {fingers: 3, spacing_mm: 30}\neffects:\n"
        "  - gaussian_noise: {sigma_us: 5000}\n",
        "nominal.yaml", effects::Catalogue());
    diagnosis::DiagnosisInput input;
    input.set = std::make_shared<const session::MeasurementSet>(*std::move(set));
    input.model = std::make_shared<const model::Model>(*std::move(model));
    for (const std::string& object : input.set->objects)
      input.surfaces[object] = objects_->surfaces.at(object);
    const auto diagnosis = diagnosis::Diagnose(input, {});
    EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
    return diagnosis.ok() ? diagnosis::report::ToReport(*diagnosis) : v1::Report();
  }

  static double Value(const v1::Step& step, const std::string& finger = "") {
    for (const v1::ParameterValue& parameter : step.parameters())
      if (parameter.finger() == finger) return parameter.value();
    ADD_FAILURE() << step.effect() << " has no value for '" << finger << "'";
    return 0;
  }

  static TestObjects* objects_;
};
TestObjects* PublicSets::objects_ = nullptr;

#define SKIP_WITHOUT(file) \
  if (!std::filesystem::exists(kFolder + (file))) GTEST_SKIP() << kFolder << (file) << " is missing"

TEST_F(PublicSets, NothingHiddenIsAdequate) {
  SKIP_WITHOUT("nothing_hidden.csv");
  const v1::Report report = Diagnosed("nothing_hidden.csv");
  EXPECT_EQ(report.verdict(), v1::Report::ADEQUATE) << ReportInWords(report);
  EXPECT_EQ(TouchEntry(report).count(), 960u);
  EXPECT_NEAR(TouchEntry(report).noise_floor(), 5000, 400);
}

TEST_F(PublicSets, TipRadiusIsNamedAndMeasured) {
  SKIP_WITHOUT("tip_radius.csv");
  const v1::Report report = Diagnosed("tip_radius.csv");
  ASSERT_GE(report.steps_size(), 1) << ReportInWords(report);
  EXPECT_EQ(report.steps(0).effect(), "tip_radius");
  EXPECT_EQ(report.verdict(), v1::Report::MISSING_EFFECTS);
  EXPECT_NEAR(Value(report.steps(0)), 1.5, 0.15);
  EXPECT_LE(TouchEntry(report).final().rmse(), 1.05 * TouchEntry(report).noise_floor());
}

TEST_F(PublicSets, ObjectPushIsNamedAndMeasured) {
  SKIP_WITHOUT("object_push.csv");
  const v1::Report report = Diagnosed("object_push.csv");
  ASSERT_EQ(report.steps_size(), 1) << ReportInWords(report);
  EXPECT_EQ(report.steps(0).effect(), "object_push");
  EXPECT_NEAR(Value(report.steps(0)), 0.3, 0.03);
  EXPECT_LE(TouchEntry(report).final().rmse(), 1.05 * TouchEntry(report).noise_floor());
}

TEST_F(PublicSets, TwoEffectsAreBothNamed) {
  SKIP_WITHOUT("two_effects.csv");
  const v1::Report report = Diagnosed("two_effects.csv");
  ASSERT_EQ(report.steps_size(), 2) << ReportInWords(report);
  for (const v1::Step& step : report.steps()) {
    if (step.effect() == "oblique_slip") {
      EXPECT_NEAR(Value(step), 0.5, 0.05);
    } else if (step.effect() == "finger_length") {
      EXPECT_THAT(step.equivalent(), Contains("channel_latency"));
      EXPECT_NEAR(Value(step, "l"), 0.2, 0.03);
      EXPECT_NEAR(Value(step, "m"), -0.05, 0.03);
      EXPECT_NEAR(Value(step, "r"), -0.15, 0.03);
    } else {
      EXPECT_EQ(step.effect(), "channel_latency");
      EXPECT_THAT(step.equivalent(), Contains("finger_length"));
    }
  }
}

TEST_F(PublicSets, WhatNoCatalogueListsIsUnexplainedAndHangsOnTheApproach) {
  SKIP_WITHOUT("unlisted.csv");
  const v1::Report report = Diagnosed("unlisted.csv");
  EXPECT_EQ(report.verdict(), v1::Report::UNEXPLAINED) << ReportInWords(report);
  ASSERT_GT(TouchEntry(report).unexplained().covariates_size(), 0);
  EXPECT_EQ(TouchEntry(report).unexplained().covariates(0).name(), "approach_z") << ReportInWords(report);
  EXPECT_GT(TouchEntry(report).unexplained().heldout_gain(), 0.5);
}

TEST_F(PublicSets, ABadPrintIsNoPhysics) {
  SKIP_WITHOUT("surface_error.csv");
  const v1::Report report = Diagnosed("surface_error.csv");
  for (const v1::Step& step : report.steps())
    EXPECT_EQ(step.effect(), "surface_error") << ReportInWords(report);
  EXPECT_NE(report.verdict(), v1::Report::UNEXPLAINED);
}

TEST_F(PublicSets, WithoutPosesNobodyIsBlamed) {
  SKIP_WITHOUT("without_poses.csv");
  const v1::Report report = Diagnosed("without_poses.csv");
  EXPECT_EQ(report.steps_size(), 0) << ReportInWords(report);
  EXPECT_TRUE(TouchEntry(report).has_distributions());
}

}  // namespace
}  // namespace touchstone::hidden
