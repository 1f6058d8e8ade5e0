#include "server/diagnosis/selection/curve_competition.h"

#include <absl/strings/str_cat.h>
#include <gtest/gtest.h>

#include "server/base/test_tier.h"
#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis::selection {
namespace {

// What the search says of a rig with this hidden.
SelectionResult ResultFor(const std::string& effect, const std::vector<std::string>& values) {
  touches::HiddenRig rig;
  rig.samples_per_face = 6;
  rig.hidden = {{effect, values}};
  auto workspace = MakeWorkspace(touches::MakeTestInput(rig), {});
  EXPECT_TRUE(workspace.ok()) << workspace.status();
  auto result = SelectExplanation(workspace->get());
  EXPECT_TRUE(result.ok()) << result.status();
  result->search.reset();  // it refers to the workspace
  return *std::move(result);
}

TEST(CurveCompetition, ADriftKeepsItsName) {
  const SelectionResult result = ResultFor("thermal_drift", {"rate_mm_per_h=0.5,0,-0.5"});
  EXPECT_FALSE(result.curve);
  ASSERT_EQ(result.steps.size(), 1u);
  EXPECT_GT(result.steps[0].probability, 0.9);
}

TEST(CurveCompetition, AStepOfOneFingerIsNoDriftAndNoLength) {
  TOUCHSTONE_SECOND_TIER("statistical: several sets");
  for (const char* mm : {"0,0.06", "0,0.2"}) {
    const SelectionResult result =
        ResultFor("lookup", {"name=step", "adds=travel_mm", "covariate=session_time_s", "knots=1199,1200",
                             absl::StrCat("l=", mm), "m=0,0", "r=0,0"});
    EXPECT_TRUE(result.curve || (!result.steps.empty() && result.steps[0].probability <= 0.9)) << mm;
    for (const engine::SelectedStep& step : result.steps)
      EXPECT_NE(step.words.find("A course in time"), std::string::npos) << mm;
  }
}

TEST(CurveCompetition, ALengthKeepsItsName) {
  const SelectionResult result = ResultFor("finger_length", {"offset_mm=0.1,-0.2,0.1"});
  EXPECT_FALSE(result.curve);
  ASSERT_EQ(result.steps.size(), 1u);
  EXPECT_GT(result.steps[0].probability, 0.9);
}

TEST(CurveCompetition, CorrelatedNoiseIsNoiseWithMemory) {
  TOUCHSTONE_SECOND_TIER("statistical: several sets");
  const SelectionResult result = ResultFor("correlated_noise", {"sigma_us=6000", "time_s=200"});
  ASSERT_TRUE(result.memory);
  EXPECT_NEAR(result.memory->sigma_s.value, 0.006, 5 * result.memory->sigma_s.std_error);
  EXPECT_TRUE(result.steps.empty());
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
