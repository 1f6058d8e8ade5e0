#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/diagnose.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis {
namespace {

using testing::HasSubstr;

DiagnosisInput WithHiddenTip() {
  touches::HiddenRig rig;
  rig.hidden = {{"tip_radius", {"radius_mm=1.5"}}};
  return touches::MakeTestInput(rig);
}

report::Diagnosis ExplanationOf(const std::string& effect) {
  auto explained = Explain(WithHiddenTip(), effect, {});
  EXPECT_TRUE(explained.ok()) << explained.status();
  return *std::move(explained);
}

TEST(ExplainTouches, TheHiddenEffectLeavesTheNoise) {
  const report::Diagnosis diagnosis = ExplanationOf("tip_radius");
  EXPECT_EQ(diagnosis.verdict, engine::Verdict::kNone);
  EXPECT_LT(diagnosis.explained->quality.rmse, 1.1 * diagnosis.data[0].noise_floor->sigma);
  EXPECT_GT(diagnosis.explained->found.probability, 0.99);
  EXPECT_EQ(diagnosis.explained->speak_for.size(), 5u);
  EXPECT_THAT(diagnosis.summary, HasSubstr("At its best (radius_mm 1."));
}

TEST(ExplainTouches, AnotherEffectNamesTheOneThatExplainsThemBetter) {
  const report::Diagnosis diagnosis = ExplanationOf("object_scale");
  EXPECT_LT(diagnosis.explained->found.probability, 0.01);
  EXPECT_THAT(diagnosis.summary, HasSubstr("tip_radius alone gains"));
}

TEST(ExplainTouches, AnEffectThatTheTouchesDoNotAskForIsExcludedBeyondItsInterval) {
  const report::Diagnosis diagnosis = ExplanationOf("return_hysteresis");
  EXPECT_THAT(diagnosis.summary,
              testing::AnyOf(HasSubstr("do not ask for it"), HasSubstr("changes nothing")));
}

TEST(ExplainTouches, NoiseIsNoEffectOfTheExpectation) {
  EXPECT_THAT(std::string(Explain(WithHiddenTip(), "heavy_tail_noise", {}).status().message()),
              HasSubstr("changes what is expected"));
}

TEST(CompareTwoModels, SaysWhichErrsLessAndGivesTheOthersError) {
  DiagnosisInput input = WithHiddenTip();
  model::Model other = touches::WithEffects(*input.model, {{"tip_radius", {"radius_mm=1.5"}}});
  other.name = "tips";
  input.other_model = std::make_shared<const model::Model>(other);
  const report::Diagnosis both = *Compare(input, {});
  input.model = input.other_model;
  input.other_model = nullptr;
  const report::Diagnosis alone = *Compare(input, {});
  ASSERT_TRUE(both.data[0].versus.has_value());
  EXPECT_EQ(both.data[0].versus->other_name, "tips");
  EXPECT_DOUBLE_EQ(both.data[0].versus->other.rmse, alone.data[0].initial->rmse);
  EXPECT_THAT(both.summary, HasSubstr("'tips' errs less than 'nominal'"));
}

TEST(CompareTwoModels, TheSameModelIsNoBetter) {
  DiagnosisInput input = WithHiddenTip();
  input.other_model = input.model;
  EXPECT_THAT(Compare(input, {})->summary, HasSubstr("expect the same"));
}

TEST(CompareTwoModels, OfDifferentFingersIsRefused) {
  DiagnosisInput input = WithHiddenTip();
  model::Model other = *input.model;
  other.fingers = 4;
  input.other_model = std::make_shared<const model::Model>(other);
  EXPECT_THAT(std::string(Compare(input, {}).status().message()), HasSubstr("4 fingers"));
}

}  // namespace
}  // namespace touchstone::diagnosis
