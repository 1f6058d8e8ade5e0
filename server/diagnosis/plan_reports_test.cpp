// A check of a plan against what diagnoses of such sets find.
#include "server/diagnosis/answers/plan_reports.h"

#include <gtest/gtest.h>

#include <absl/strings/str_cat.h>

#include "server/base/test_tier.h"
#include "server/diagnosis/diagnose.h"
#include "server/diagnosis/engine/competition/rules.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis {
namespace {

report::Diagnosis CheckOf(const touches::HiddenRig& rig) {
  auto check = Check(touches::MakeTestInput(rig), {}, {});
  EXPECT_TRUE(check.ok()) << check.status();
  return *std::move(check);
}

TEST(CheckTouchPlan, GivesNoVerdictAndNamesWhatIsMissed) {
  const report::Diagnosis check = CheckOf({});
  EXPECT_EQ(check.verdict, engine::Verdict::kNone);
  EXPECT_EQ(check.data[0].noise_floor->sigma, 2000);
  EXPECT_FALSE(check.detectable.empty());
  int missed = 0;
  for (const engine::DetectableValue& value : check.detectable)
    missed += value.effect->name == "return_hysteresis" &&
              value.power_at_typical < engine::kCompetitionRules.detection_power;
  EXPECT_EQ(missed > 0, check.summary.find("return_hysteresis") != std::string::npos) << check.summary;
}

// Of `sets` sets with the effect hidden, those whose diagnosis names it, or what it cannot be told from.
int Named(touches::HiddenRig rig, const std::string& effect, const std::string& value, int sets) {
  int named = 0;
  rig.hidden = {{effect, {value}}};
  rig.pose_seed = rig.seed;
  for (int set = 0; set < sets; ++set) {
    rig.seed = 1000 + static_cast<uint64_t>(set);
    const auto diagnosis = Diagnose(touches::MakeTestInput(rig), {});
    EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
    bool is_named = false;
    for (const report::Step& step : diagnosis->steps)
      is_named |=
          step.effect == effect || std::count(step.equivalent.begin(), step.equivalent.end(), effect) > 0;
    named += is_named;
  }
  return named;
}

class PredictedPower : public testing::TestWithParam<std::pair<const char*, const char*>> {};

TEST_P(PredictedPower, IsThatOfDiagnoses) {
  TOUCHSTONE_SECOND_TIER("40 diagnoses an effect");
  const auto [effect, format] = GetParam();
  touches::HiddenRig rig;
  double size = 0;
  for (const engine::DetectableValue& value : CheckOf(rig).detectable)
    if (value.effect->name == effect && value.found_from && size == 0) size = *value.found_from;
  ASSERT_GT(size, 0) << effect;
  std::string value = format;
  for (const auto& [mark, factor] : {std::pair("#", 1.0), std::pair("%", -0.5)})
    for (size_t at; (at = value.find(mark)) != std::string::npos;)
      value.replace(at, 1, absl::StrCat(factor * size));
  constexpr int kSets = 40;
  const int named = Named(rig, effect, value, kSets);
  RecordProperty("named", named);
  // 32 expected; 2.5 standard deviations.
  EXPECT_NEAR(named, engine::kCompetitionRules.detection_power * kSets, 6.5) << effect << " " << value;
}

INSTANTIATE_TEST_SUITE_P(
    Effects, PredictedPower,
    testing::Values(std::pair("tip_radius", "radius_mm=#"), std::pair("gravity_sag", "drop_mm=#"),
                    std::pair("speed_error", "relative=#"), std::pair("object_push", "shift_mm=#"),
                    std::pair("return_hysteresis", "fraction=#"), std::pair("oblique_slip", "travel_mm=#")));

}  // namespace
}  // namespace touchstone::diagnosis
