#include "tests/hidden_effects/score/verify.h"

#include <gtest/gtest.h>

#include "tests/hidden_effects/score/expect_always.h"

namespace touchstone::hidden {
namespace {

Scenario WithPush() {
  Scenario scenario;
  scenario.hidden = {{"object_push", {0.4}}};
  return scenario;
}

v1::Report ReportOf(const char* effect, double value) {
  v1::Report report;
  report.add_data()->set_noise_floor(4900);
  v1::Step* step = report.add_steps();
  step->set_effect(effect);
  step->add_parameters()->set_value(value);
  return report;
}

TEST(FreshRmse, IsTheNoiseWithTheTrueModelAndMoreWithoutIt) {
  const Scenario truth = [] {
    const Arm& arm = *FindArm("one");
    Scenario scenario = arm.draw(SharedTestObjects(), SeedOf(Seeds::kTuning, arm, 0));
    scenario.hidden = {{"object_push", {0.4}}};
    return scenario;
  }();
  v1::Report report;
  const auto without = FreshRmseUs(truth, 3, report, SharedTestObjects());
  report.set_improved_model_yaml(
      WithEffect(Generate(truth, 3).model_yaml, "  - object_push: {shift_mm: 0.4}\n"));
  const auto with = FreshRmseUs(truth, 3, report, SharedTestObjects());
  ASSERT_TRUE(without.ok() && with.ok()) << without.status() << with.status();
  EXPECT_NEAR(*with, truth.sigma_us, 0.05 * truth.sigma_us);
  EXPECT_GT(*without, 1.2 * *with);
}

TEST(FittedCopy, HasTheValueAndTheNoiseThatWereFound) {
  const auto copy = FittedCopy(WithPush(), ReportOf("object_push", 0.41));
  ASSERT_TRUE(copy);
  EXPECT_EQ(copy->hidden[0].values[0], 0.41);
  EXPECT_EQ(copy->sigma_us, 4900);
  EXPECT_EQ(copy->model_sigma_us, 5000);
}

TEST(FittedCopy, IsNotMadeOfAWrongName) {
  EXPECT_FALSE(FittedCopy(WithPush(), ReportOf("tip_radius", 0.41)));
  EXPECT_FALSE(FittedCopy(WithPush(), v1::Report()));
}

TEST(FittedCopy, IsNotMadeWhereTheValuesAreOthers) {
  v1::Report per_object = ReportOf("object_push", 0.41);
  per_object.mutable_steps(0)->add_parameters()->set_value(0.2);
  EXPECT_FALSE(FittedCopy(WithPush(), per_object));
}

TEST(FittedCopy, IsMarkedAtItsOwnValue) {
  const Arm& arm = *FindArm("one");
  Scenario truth = arm.draw(SharedTestObjects(), SeedOf(Seeds::kTuning, arm, 0));
  truth.hidden = {{"object_push", {0.4}}};
  const std::vector<Mark> marks =
      CoverageOfCopies(arm, truth, ReportOf("object_push", 0.4), 1, 1, SharedTestObjects());
  ASSERT_EQ(marks.size(), 1u);
  EXPECT_EQ(marks[0].measure, kCopyCovers);
  EXPECT_TRUE(marks[0].yes);
}

}  // namespace
}  // namespace touchstone::hidden
