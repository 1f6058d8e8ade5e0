#include "server/diagnosis/design/plan_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis::design {
namespace {

using testing::HasSubstr;

DiagnosisInput Plan() {
  return touches::MakeTestInput({});
}

PlanCheck Checked(const DiagnosisInput& input, const PlanQuestion& question = {}) {
  auto check = CheckPlan(input, question, {});
  EXPECT_TRUE(check.ok()) << check.status();
  return *std::move(check);
}

const engine::DetectableValue& ValueOf(const PlanCheck& check, const std::string& effect) {
  for (const engine::DetectableValue& value : check.values)
    if (value.effect->name == effect) return value;
  ADD_FAILURE() << effect << " is not there";
  return check.values[0];
}

std::string ErrorOf(const DiagnosisInput& input, const PlanQuestion& question) {
  return std::string(CheckPlan(input, question, {}).status().message());
}

TEST(CheckPlan, TakesTheNoiseOfTheModel) {
  EXPECT_NEAR(Checked(Plan()).sigma_s, 0.002, 1e-12);
}

TEST(CheckPlan, TakesNoiseOfAnyKindFromADrawOfEveryTouch) {
  DiagnosisInput input = Plan();
  input.model = std::make_shared<const model::Model>(
      touches::WithEffects(model::NominalModel(), {{"position_noise", {"sigma_mm=0.04"}}}));
  // 0.04 mm at 20 mm/s are 2 ms; 432 differences of fingers know that within 10 %.
  EXPECT_NEAR(Checked(input).sigma_s, 0.002, 2e-4);
}

TEST(CheckPlan, ReadsNoTimes) {
  DiagnosisInput input = Plan();
  auto plan = std::make_shared<session::MeasurementSet>(*input.set);
  plan->fingers = 0;
  plan->time_s.clear();
  const PlanCheck measured = Checked(input);
  input.set = plan;
  const PlanCheck planned = Checked(input);
  ASSERT_EQ(planned.values.size(), measured.values.size());
  for (size_t i = 0; i < planned.values.size(); ++i) {
    EXPECT_EQ(planned.values[i].found_from, measured.values[i].found_from) << planned.values[i].effect->name;
    EXPECT_EQ(planned.values[i].rival, measured.values[i].rival);
  }
}

TEST(CheckPlan, SpeedAndClockAreNeverToldApartByRelativeTimes) {
  const PlanCheck check = Checked(Plan());
  const engine::DetectableValue& speed = ValueOf(check, "speed_error");
  EXPECT_EQ(speed.rival, "clock_skew");
  EXPECT_GT(speed.correlation, 0.999);
  EXPECT_FALSE(speed.told_from.has_value());
}

TEST(CheckPlan, ATipIsFoundFromASmallerSizeThanItIsToldFrom) {
  const PlanCheck check = Checked(Plan());
  const engine::DetectableValue& tip = ValueOf(check, "tip_radius");
  ASSERT_TRUE(tip.found_from.has_value());
  EXPECT_FALSE(tip.rival.empty());
  if (tip.told_from) {
    EXPECT_GE(*tip.told_from, *tip.found_from);
  }
}

TEST(CheckPlan, ProposedTouchesFindTheEffectAtASmallerSize) {
  PlanQuestion question;
  question.improve = 24;
  question.find = "tip_radius";
  const DiagnosisInput input = Plan();
  const PlanCheck check = Checked(input, question);
  ASSERT_EQ(check.proposed.size(), 24u);
  EXPECT_EQ(check.proposed[0].purpose, "tells tip_radius from the model as it is");
  auto more = std::make_shared<session::MeasurementSet>(*input.set);
  for (const ProposedTouch& proposed : check.proposed) {
    more->touch.push_back(more->touch.size());
    more->object.push_back(static_cast<int>(
        std::find(more->objects.begin(), more->objects.end(), proposed.object) - more->objects.begin()));
    more->target_m.push_back(proposed.touch.target_m);
    more->approach.push_back(proposed.touch.approach);
    more->lateral.push_back(proposed.touch.lateral);
    more->standoff_m.push_back(proposed.touch.standoff_m);
    more->speed_m_s.push_back(proposed.touch.speed_m_s);
    more->session_time_s.push_back(more->session_time_s.back() + 9);
    more->line.push_back(more->line.back() + 1);
    for (int i = 0; i < 3; ++i) more->time_s.push_back(0);
  }
  DiagnosisInput improved = input;
  improved.set = more;
  // 24 more of 216 touches of the same kind would lower it by 5 %.
  EXPECT_LT(*ValueOf(Checked(improved), "tip_radius").found_from,
            0.9 * *ValueOf(check, "tip_radius").found_from);
}

TEST(CheckPlan, TouchesThatTellTwoEffectsApartAreNamedSo) {
  PlanQuestion question;
  question.improve = 6;
  question.between = {"finger_length", "channel_latency"};
  const PlanCheck check = Checked(Plan(), question);
  ASSERT_EQ(check.proposed.size(), 6u);
  for (const ProposedTouch& touch : check.proposed) {
    EXPECT_EQ(touch.purpose, "tells finger_length from channel_latency");
    EXPECT_GT(std::abs(touch.touch.speed_m_s - 0.02), 0.005);  // only another speed does
  }
}

TEST(CheckPlan, SaysWhatIsWrongWithAQuestion) {
  DiagnosisInput silent = Plan();
  silent.model = std::make_shared<const model::Model>(model::NominalModel());
  EXPECT_THAT(ErrorOf(silent, {}), HasSubstr("has no noise"));
  EXPECT_THAT(ErrorOf(Plan(), {0, 4, "", {}}), HasSubstr("depends on the question"));
  EXPECT_THAT(ErrorOf(Plan(), {0, 4, "tip_radios", {}}), HasSubstr("'tip_radios' is no effect"));
  EXPECT_THAT(ErrorOf(Plan(), {0, 4, "", {"tip_radius", "tip_radius"}}), HasSubstr("two different effects"));
  EXPECT_THAT(ErrorOf(Plan(), {0, 0, "tip_radius", {}}), HasSubstr("how many touches"));
}

}  // namespace
}  // namespace touchstone::diagnosis::design
