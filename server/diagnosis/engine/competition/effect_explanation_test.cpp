#include "server/diagnosis/engine/competition/effect_explanation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/diagnosis/engine/fit/linear_test_model.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::engine {
namespace {

constexpr double kExplainSigma = 0.005;
constexpr double kExplainColumn = 50;  // per m

// Rows that follow object_push; oblique_slip does half of the same.
class ExplainEffectTest : public ::testing::Test {
 protected:
  ExplainEffectTest() : rows(4, 50, 2) {
    rows.columns["object_push"] = rows.Random(1, kExplainColumn);
    rows.columns["oblique_slip"] =
        std::sqrt(0.5) * (rows.columns["object_push"] + rows.Random(2, kExplainColumn));
    rows.columns["tip_radius"] = rows.Random(3, kExplainColumn);
    rows.columns["gravity_sag"] = Eigen::VectorXd::Zero(rows.rows());
    rows.measured = 1e-3 * rows.columns["object_push"] + rows.Random(9, kExplainSigma);
    likelihood = std::make_unique<Likelihood>(rows.GroupRows(), nullptr, 0, nullptr);
    experiment.observations = &rows;
    experiment.likelihood = likelihood.get();
  }
  absl::StatusOr<EffectExplanation> Explain(const std::string& effect) {
    std::vector<Candidate> candidates;
    for (const auto& [name, column] : rows.columns)
      candidates.push_back({effects::Catalogue().Find(name), false, false, {}});
    const StepwiseSearch search(experiment, candidates, SearchRules(), [](const std::string&) {});
    return ExplainEffect(search, *FitModel(experiment, {model::NominalModel(), rows.groups()}), 0, effect);
  }
  LinearTestModel rows;
  std::unique_ptr<Likelihood> likelihood;
  Experiment experiment;
};

TEST_F(ExplainEffectTest, TheCauseHasItsValueAndNearlyAllProbability) {
  const EffectExplanation push = *Explain("object_push");
  ASSERT_EQ(push.parameters[0].name, "shift_mm");
  EXPECT_NEAR(push.parameters[0].value, 1, 4 * push.parameters[0].std_error);
  EXPECT_GT(push.probability, 0.99);
  EXPECT_GT(push.gain_nats, 100);
}

TEST_F(ExplainEffectTest, WhatDoesHalfOfItIsTakenOverByTheCause) {
  const EffectExplanation slip = *Explain("oblique_slip");
  EXPECT_GT(slip.gain_nats, slip.needed_nats);
  EXPECT_LT(slip.probability, 0.01);
  ASSERT_FALSE(slip.taken_over.empty());
  EXPECT_EQ(slip.taken_over[0].effect, "object_push");
  EXPECT_NEAR(slip.taken_over[0].share, 0.5, 0.15);
  EXPECT_GT(slip.taken_over[0].gain_nats, slip.gain_nats);
}

TEST_F(ExplainEffectTest, AnotherEffectGainsNothing) {
  const EffectExplanation tip = *Explain("tip_radius");
  EXPECT_LT(tip.gain_nats, tip.needed_nats);
  EXPECT_LT(tip.probability, 0.01);
}

TEST_F(ExplainEffectTest, AValueAtItsBoundHasTheLimitThatTheRowsExclude) {
  // A push of -0.2 mm is none: the rows exclude what lies two standard errors beyond that, and no more.
  rows.measured = -2e-4 * rows.columns["object_push"] + rows.Random(9, kExplainSigma);
  const EffectExplanation push = *Explain("object_push");
  EXPECT_FALSE(push.changes);
  EXPECT_EQ(push.parameters[0].value, 0);
  const double error_mm = 1e3 * kExplainSigma / rows.columns["object_push"].norm();
  EXPECT_GT(push.parameters[0].upper, 0);
  EXPECT_LT(push.parameters[0].upper, 2 * error_mm);
}

TEST_F(ExplainEffectTest, WhatShowsOnlyFromASizeOnIsFittedThere) {
  rows.dead = 0.5e-3;
  const EffectExplanation push = *Explain("object_push");
  ASSERT_TRUE(push.visible);
  ASSERT_EQ(push.parameters.size(), 1u);
  EXPECT_NEAR(push.parameters[0].value, 1.5, 4 * push.parameters[0].std_error);
  EXPECT_GT(push.gain_nats, 50);
}

TEST_F(ExplainEffectTest, WhatMovesNoRowIsNotVisible) {
  const EffectExplanation sag = *Explain("gravity_sag");
  EXPECT_FALSE(sag.visible);
  EXPECT_FALSE(sag.fit.has_value());
  EXPECT_EQ(sag.probability, 0);
}

// A column of zeros made the least squares a NaN, which sorted before every share.
TEST_F(ExplainEffectTest, WhatMovesNoRowTakesNothingOver) {
  const EffectExplanation push = *Explain("object_push");
  for (const TakenOver& taken : push.taken_over) {
    EXPECT_NE(taken.effect, "gravity_sag");
    EXPECT_TRUE(std::isfinite(taken.share)) << taken.effect;
  }
}

TEST_F(ExplainEffectTest, AnEffectThatIsNoCandidateIsRefusedByName) {
  EXPECT_THAT(std::string(Explain("gaussian_noise").status().message()),
              testing::AllOf(testing::HasSubstr("'gaussian_noise' is no effect"),
                             testing::HasSubstr("object_push, oblique_slip")));
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
