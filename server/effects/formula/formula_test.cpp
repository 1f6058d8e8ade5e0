#include "server/effects/formula/formula.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "server/base/units.h"
#include "server/effects/effect_test_batch.h"

namespace touchstone::effects {
namespace {

using testing::HasSubstr;

model::FormulaSpec Spec(const std::string& expression, model::Stage stage = model::Stage::kMotion) {
  model::FormulaSpec spec;
  spec.name = "mine";
  spec.expression = expression;
  spec.stage = stage;
  return spec;
}

void Declare(model::FormulaSpec* spec, const std::string& name, double value, Unit unit, double lower,
             double upper) {
  model::ParameterInfo parameter;
  parameter.name = name;
  parameter.unit = unit;
  parameter.lower = lower;
  parameter.upper = upper;
  spec->parameters.push_back(parameter);
  spec->values.push_back(value);
}

std::string ErrorOf(const model::FormulaSpec& spec) {
  const auto effect = MakeFormulaEffect(spec);
  return effect.ok() ? "no error" : std::string(effect.status().message());
}

std::string ErrorOf(const std::string& expression, model::Stage stage = model::Stage::kMotion) {
  return ErrorOf(Spec(expression, stage));
}

TEST(Formula, ReproducesALeadScrewInTheUnitsOfFiles) {
  model::FormulaSpec spec = Spec("k * sin(2*pi*travel_mm/lead)");
  Declare(&spec, "k", 0.1, Unit::kMillimetre, -1, 1);
  Declare(&spec, "lead", 4, Unit::kMillimetre, 2, 10);
  const auto effect = MakeFormulaEffect(spec);
  ASSERT_TRUE(effect.ok()) << effect.status();
  const TouchBatch before = TestBatch(10, 3);
  TouchBatch after = before;
  ApplyEffect(**effect, {{"k", {0.5}}, {"lead", {5}}}, &after);
  for (size_t i = 0; i < before.travel_m.size(); ++i)
    EXPECT_NEAR(after.travel_m[i] - before.travel_m[i],
                0.5e-3 * std::sin(2 * kPi * before.travel_m[i] / 5e-3), 1e-15);
  EXPECT_THAT(ChangedFields(before, after), testing::ElementsAre("travel_m"));
}

TEST(Formula, ActsInTheStageThatItNames) {
  const struct {
    model::Stage stage;
    bool adds_time;
    const char* field;
  } cases[] = {{model::Stage::kPose, false, "travel_offset_m"},
               {model::Stage::kContact, false, "travel_m"},
               {model::Stage::kMotion, false, "travel_m"},
               {model::Stage::kSensor, false, "reported_time_s"},
               {model::Stage::kSensor, true, "reported_time_s"}};
  for (const auto& c : cases) {
    model::FormulaSpec spec = Spec("1 + finger", c.stage);
    spec.adds_time = c.adds_time;
    const auto effect = MakeFormulaEffect(spec);
    ASSERT_TRUE(effect.ok()) << effect.status();
    EXPECT_EQ((*effect)->stage, c.stage);
    const TouchBatch before = TestBatch(10, 3);
    TouchBatch after = before;
    ApplyEffect(**effect, {}, &after);
    EXPECT_THAT(ChangedFields(before, after), testing::ElementsAre(c.field));
  }
}

TEST(Formula, TurnsAddedTravelIntoTimeInTheSensorStage) {
  model::FormulaSpec spec = Spec("2", model::Stage::kSensor);
  TouchBatch before = TestBatch(4, 3);
  TouchBatch after = before;
  ApplyEffect(**MakeFormulaEffect(spec), {}, &after);
  for (size_t i = 0; i < before.reported_time_s.size(); ++i)
    EXPECT_NEAR(after.reported_time_s[i] - before.reported_time_s[i], 2e-3 * before.time_per_travel_s_m[i],
                1e-13);
  spec.adds_time = true;
  after = before;
  ApplyEffect(**MakeFormulaEffect(spec), {}, &after);
  for (size_t i = 0; i < before.reported_time_s.size(); ++i)
    EXPECT_NEAR(after.reported_time_s[i] - before.reported_time_s[i], 2e-6, 1e-13);
}

TEST(Formula, KnowsEveryVariableWithItsMeaning) {
  TouchBatch touches = TestBatch(3, 3);
  touches.covariates["cov_humidity"] = {0.25, 0.5, 0.75};
  const int touch = 1;
  const int finger = 2;
  const int entry = touches.At(finger, touch);
  const std::vector<std::pair<std::string, double>> expected = {
      {"finger", 1},
      {"speed_mm_s", touches.speed_m_s[touch] * kMillimetresPerMetre},
      {"session_time_s", touches.session_time_s[touch]},
      {"pause_s", touches.pause_s[touch]},
      {"previous_press_mm", touches.previous_press_m[entry] * kMillimetresPerMetre},
      {"approach_x", touches.approach[touch].x()},
      {"approach_y", touches.approach[touch].y()},
      {"approach_z", touches.approach[touch].z()},
      {"lateral_x", touches.lateral[touch].x()},
      {"lateral_y", touches.lateral[touch].y()},
      {"lateral_z", touches.lateral[touch].z()},
      {"travel_mm", touches.travel_m[entry] * kMillimetresPerMetre},
      {"incidence_deg", std::acos(touches.cos_incidence[entry]) / kRadiansPerDegree},
      {"curvature_per_m", touches.curvature_per_m[entry]},
      {"normal_x", touches.normal[entry].x()},
      {"normal_y", touches.normal[entry].y()},
      {"normal_z", touches.normal[entry].z()},
      {"contact_x_mm", touches.contact_m[entry].x() * kMillimetresPerMetre},
      {"contact_y_mm", touches.contact_m[entry].y() * kMillimetresPerMetre},
      {"contact_z_mm", touches.contact_m[entry].z() * kMillimetresPerMetre},
      {"first", touches.first_finger[touch] == finger ? 1.0 : 0.0},
      {"first_finger", touches.first_finger[touch] - 1.0},
      {"cov_humidity", 0.5}};
  ASSERT_EQ(expected.size(), FormulaVariables().size() + 1);
  for (const auto& [name, value] : expected) {
    model::FormulaSpec spec = Spec(name, model::Stage::kSensor);
    spec.adds_time = true;
    const auto effect = MakeFormulaEffect(spec);
    ASSERT_TRUE(effect.ok()) << effect.status();
    TouchBatch after = touches;
    std::fill(after.reported_time_s.begin(), after.reported_time_s.end(), 0.0);
    ApplyEffect(**effect, {}, &after);
    EXPECT_NEAR(after.reported_time_s[entry] * kMicrosecondsPerSecond, value, 1e-9 * (1 + std::fabs(value)))
        << name;
  }
}

TEST(Formula, KnowsEveryFunctionAndConstantThatItLists) {
  TouchBatch touches = TestBatch(1, 1);
  const std::vector<std::pair<std::string, double>> expected = {{"sin(1)", std::sin(1)},
                                                                {"cos(1)", std::cos(1)},
                                                                {"tan(1)", std::tan(1)},
                                                                {"asin(0.5)", std::asin(0.5)},
                                                                {"acos(0.5)", std::acos(0.5)},
                                                                {"atan(2)", std::atan(2)},
                                                                {"atan2(-1,-2)", std::atan2(-1, -2)},
                                                                {"sinh(1)", std::sinh(1)},
                                                                {"cosh(1)", std::cosh(1)},
                                                                {"tanh(1)", std::tanh(1)},
                                                                {"exp(2)", std::exp(2)},
                                                                {"log(10)", std::log(10)},
                                                                {"log10(1000)", 3},
                                                                {"sqrt(2)", std::sqrt(2)},
                                                                {"abs(-3)", 3},
                                                                {"sign(-3)", -1},
                                                                {"floor(-1.5)", -2},
                                                                {"ceil(-1.5)", -1},
                                                                {"round(2.5)", 3},
                                                                {"hypot(3,4)", 5},
                                                                {"min(3,1,2)", 1},
                                                                {"max(3,1,2)", 3},
                                                                {"pi", kPi},
                                                                {"e", std::exp(1)}};
  ASSERT_EQ(expected.size(), FormulaFunctions().size() + FormulaConstants().size());
  for (const auto& [expression, value] : expected) {
    model::FormulaSpec spec = Spec(expression, model::Stage::kPose);
    const auto effect = MakeFormulaEffect(spec);
    ASSERT_TRUE(effect.ok()) << effect.status();
    TouchBatch after = touches;
    ApplyEffect(**effect, {}, &after);
    EXPECT_NEAR(after.travel_offset_m[0] * kMillimetresPerMetre, value, 1e-13) << expression;
  }
}

TEST(Formula, ComparesAndChooses) {
  TouchBatch touches = TestBatch(1, 3);
  ApplyEffect(
      **MakeFormulaEffect(Spec("finger > 0 ? 1 : (finger == 0 && 2 >= 2 ? 5 : -2^2)", model::Stage::kPose)),
      {}, &touches);
  EXPECT_NEAR(touches.travel_offset_m[0], -0.004, 1e-15);
  EXPECT_NEAR(touches.travel_offset_m[1], 0.005, 1e-15);
  EXPECT_NEAR(touches.travel_offset_m[2], 0.001, 1e-15);
}

TEST(Formula, SaysWhatItNeeds) {
  const auto needs = [](const char* expression) {
    return (*MakeFormulaEffect(Spec(expression, model::Stage::kSensor)))->needs;
  };
  EXPECT_TRUE(needs("curvature_per_m").curvature);
  EXPECT_FALSE(needs("travel_mm").curvature);
  EXPECT_TRUE(needs("pause_s").session_time);
  EXPECT_TRUE(needs("previous_press_mm").previous_press);
  EXPECT_THAT(needs("cov_b + cov_a*cov_b").covariates, testing::ElementsAre("cov_b", "cov_a"));
}

TEST(Formula, RefusesWhatIsNotArithmeticWithThePlace) {
  EXPECT_THAT(ErrorOf("travle_mm * 2"),
              HasSubstr("character 1: unknown variable 'travle_mm', did you mean 'travel_mm'?"));
  EXPECT_THAT(ErrorOf("2 * travle_mm"), HasSubstr("character 5"));
  EXPECT_THAT(ErrorOf("2 * (finger"), HasSubstr("character"));
  EXPECT_THAT(ErrorOf("finger = 3"), HasSubstr("character 8: a formula cannot assign"));
  EXPECT_THAT(ErrorOf("\"text\""), HasSubstr("character 1: '\\\"' has no place in a formula"));
  EXPECT_THAT(ErrorOf("finger; 3"), HasSubstr("character 7: ';'"));
  EXPECT_THAT(ErrorOf("1, 2"), HasSubstr("2 results"));
  EXPECT_THAT(ErrorOf("  "), HasSubstr("empty"));
  EXPECT_THAT(ErrorOf("system(1)"), HasSubstr("character"));
  EXPECT_THAT(ErrorOf(std::string(1001, '1')), HasSubstr("1001 characters; at most 1000"));
  EXPECT_THAT(ErrorOf("sin"), HasSubstr("character"));
  EXPECT_THAT(ErrorOf("sin()"), HasSubstr("character"));
  EXPECT_THAT(ErrorOf("1 +"), HasSubstr("character"));
  EXPECT_THAT(ErrorOf(std::string("1\0+1", 4)), HasSubstr("character 2"));
}

TEST(Formula, RefusesVariablesThatItsStageDoesNotKnow) {
  EXPECT_THAT(ErrorOf("travel_mm", model::Stage::kPose),
              HasSubstr("travel_mm is known from the contact stage on"));
  EXPECT_THAT(ErrorOf("first", model::Stage::kContact), HasSubstr("first is known from the motion stage on"));
  EXPECT_EQ(ErrorOf("first + travel_mm", model::Stage::kMotion), "no error");
  model::FormulaSpec spec = Spec("1", model::Stage::kMotion);
  spec.adds_time = true;
  EXPECT_THAT(ErrorOf(spec), HasSubstr("time_us can be added in the sensor stage only"));
}

TEST(Formula, RefusesParametersThatMakeNoSense) {
  model::FormulaSpec unused = Spec("finger");
  Declare(&unused, "k", 0, Unit::kMillimetre, -1, 1);
  EXPECT_THAT(ErrorOf(unused), HasSubstr("parameter 'k' is not used"));
  model::FormulaSpec outside = Spec("k");
  Declare(&outside, "k", 2, Unit::kMillimetre, -1, 1);
  EXPECT_THAT(ErrorOf(outside), HasSubstr("value 2 must lie in -1 to 1 mm"));
  model::FormulaSpec taken = Spec("finger");
  Declare(&taken, "finger", 0, Unit::kNone, -1, 1);
  EXPECT_THAT(ErrorOf(taken), HasSubstr("take another"));
  model::FormulaSpec twice = Spec("k");
  Declare(&twice, "k", 0, Unit::kNone, -1, 1);
  Declare(&twice, "k", 0, Unit::kNone, -1, 1);
  EXPECT_THAT(ErrorOf(twice), HasSubstr("declared twice"));
  model::FormulaSpec reversed = Spec("k");
  Declare(&reversed, "k", 0, Unit::kNone, 1, -1);
  EXPECT_THAT(ErrorOf(reversed), HasSubstr("must be below max"));
}

TEST(Formula, ReportsValuesThatAreNotFiniteAndSkipsMisses) {
  TouchBatch touches = TestBatch(4, 3);
  ApplyEffect(**MakeFormulaEffect(Spec("log(finger)")), {}, &touches);
  EXPECT_THAT(touches.formula_error, HasSubstr("formula 'mine' gives"));
  EXPECT_THAT(touches.formula_error, HasSubstr("for touch 100, finger 0 (finger = -1)"));

  // Without contact there is no travel to take the logarithm of, and nothing is wrong.
  TouchBatch misses = TestBatch(20, 3, 1, /*all_hit=*/false);
  ApplyEffect(**MakeFormulaEffect(Spec("log(travel_mm)")), {}, &misses);
  EXPECT_EQ(misses.formula_error, "");

  TouchBatch without = TestBatch(4, 3);
  ApplyEffect(**MakeFormulaEffect(Spec("cov_heat")), {}, &without);
  EXPECT_THAT(without.formula_error, HasSubstr("needs the column cov_heat"));
}

TEST(Formula, GivesTheSameFromManyThreadsAtOnce) {
  model::FormulaSpec spec = Spec("k * sin(travel_mm) + finger * incidence_deg");
  Declare(&spec, "k", 1, Unit::kMillimetre, -10, 10);
  const auto effect = *MakeFormulaEffect(spec);
  std::vector<TouchBatch> batches;
  std::vector<TouchBatch> expected;
  for (int i = 0; i < 8; ++i) {
    batches.push_back(TestBatch(200, 3, i));
    expected.push_back(batches.back());
    ApplyEffect(*effect, {{"k", {static_cast<double>(i)}}}, &expected.back());
  }
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i)
    threads.emplace_back([&, i] { ApplyEffect(*effect, {{"k", {static_cast<double>(i)}}}, &batches[i]); });
  for (std::thread& thread : threads) thread.join();
  for (int i = 0; i < 8; ++i) EXPECT_TRUE(ChangedFields(expected[i], batches[i]).empty());
}

}  // namespace
}  // namespace touchstone::effects
