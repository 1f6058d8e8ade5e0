#include "server/diagnosis/selection/selection.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/test_tier.h"
#include "server/diagnosis/selection/simulated_test_search.h"

namespace touchstone::diagnosis::selection {
namespace {

TEST(SelectExplanation, FindsOneStepWithItsProbabilityAndNoSurfaceError) {
  touches::HiddenRig rig;
  rig.hidden = {{"tip_radius", {"radius_mm=1.5"}}};
  const Selected selected = SelectFor(touches::MakeTestInput(rig));
  const SelectionResult& result = selected.result;
  ASSERT_EQ(result.steps.size(), 1u);
  EXPECT_EQ(result.fit.model.base().effects[result.steps[0].effect].effect->name, "tip_radius");
  EXPECT_GT(result.steps[0].gain_nats, 50);
  EXPECT_GT(result.steps[0].probability, 0.9);
  EXPECT_LT(result.formula, 0);
  EXPECT_LT(result.surface_error.gain_nats, 5);
  EXPECT_NEAR(result.noise.sigma_s.value, rig.sigma_us * 1e-6, 0.1 * rig.sigma_us * 1e-6);
}

// More touches than the search takes in: what fewer of them show must not be lost.
TEST(SelectExplanation, FindsADriftInAnyNumberOfRepeats) {
  TOUCHSTONE_SECOND_TIER("repeated: one to many repeats");
  double std_error = INFINITY;
  for (const int rounds : {14, 50}) {  // 1,008 and 3,600 touches
    SCOPED_TRACE(rounds);
    touches::HiddenRig rig;
    rig.sigma_us = 5000;
    rig.rounds = rounds;
    rig.hidden = {{"thermal_drift", {"rate_mm_per_h=0.04,-0.02,-0.02"}}};
    const Selected selected = SelectFor(touches::MakeTestInput(rig));
    EXPECT_EQ(selected.workspace->thinned, rounds == 50);
    ASSERT_EQ(selected.result.steps.size(), 1u);
    const engine::Fit& fit = selected.result.fit;
    const int step = selected.result.steps[0].effect;
    EXPECT_EQ(fit.model.base().effects[step].effect->name, "thermal_drift");
    EXPECT_FALSE(selected.result.curve.has_value());
    EXPECT_LT(selected.result.formula, 0);
    // 3.6 times as long a session, 2.4 times as many touches in the search: 5.5 times as sure.
    const auto estimates = fit.model.Describe(step, fit.point, fit.covariance);
    EXPECT_LT(estimates[0].std_error, std_error / 4);
    std_error = estimates[0].std_error;
  }
}

TEST(SelectExplanation, NamesACompetingEffectThatTheseDataCannotTellFromTheStep) {
  touches::HiddenRig rig;
  rig.hidden = {{"channel_latency", {"latency_us=9000,-3000,-6000"}}};
  const Selected selected = SelectFor(touches::MakeTestInput(rig));
  ASSERT_GE(selected.result.steps.size(), 1u);
  ASSERT_FALSE(selected.result.steps[0].competing.empty());
  EXPECT_TRUE(selected.result.steps[0].competing[0].equivalent);
}

TEST(SelectExplanation, LeavesOutliersOutWithTheirReason) {
  DiagnosisInput input = touches::MakeTestInput({});
  auto set = std::make_shared<session::MeasurementSet>(*input.set);
  for (const int row : {10, 60, 110}) set->time_s[static_cast<size_t>(row) * set->fingers] += 0.5;
  input.set = set;
  const Selected selected = SelectFor(input);
  const touches::Observations& o = *selected.workspace->observations;
  EXPECT_EQ(o.unused.count(touches::kOutlierReason), 1u);
  for (int k = 0; k < o.size(); ++k) {
    if (o.row[k] != 10 && o.row[k] != 60 && o.row[k] != 110) continue;
    EXPECT_FALSE(o.used[k]) << o.row[k];
  }
  EXPECT_TRUE(selected.result.steps.empty());
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
