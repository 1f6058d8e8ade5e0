#include "server/diagnosis/engine/competition/competition.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/diagnosis/engine/competition/rules.h"
#include "server/diagnosis/engine/fit/linear_test_model.h"
#include "server/diagnosis/engine/ladder/ladder.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::engine {
namespace {

constexpr double kNoiseS = 0.005;
constexpr double kPerMetre = 50;
constexpr double kHiddenM = 0.8e-3;

// Rows that follow columns of the catalogue's effects, which need not be what those effects do.
class CompetitionTest : public ::testing::Test {
 protected:
  CompetitionTest() : rows(4, 25, 2) {
    for (const char* effect : {"object_push", "oblique_slip", "gravity_sag"})
      rows.columns[effect] = rows.Random(rows.columns.size() + 1, kPerMetre);
    rows.measured = rows.Random(9, kNoiseS);
    likelihood = std::make_unique<Likelihood>(rows.GroupRows(), nullptr, 0, nullptr);
    experiment.observations = &rows;
    experiment.likelihood = likelihood.get();
  }
  StepwiseSearch Search(const std::vector<const char*>& effects) const {
    std::vector<Candidate> candidates;
    for (const char* effect : effects) candidates.push_back({effects::Catalogue().Find(effect)});
    return {experiment, std::move(candidates), SearchRules(), [](const std::string&) {}};
  }
  Explanation Explained(const StepwiseSearch& search) const {
    return *search.Run({model::NominalModel(), rows.groups()}, 0);
  }

  LinearTestModel rows;
  std::unique_ptr<Likelihood> likelihood;
  Experiment experiment;
};

TEST_F(CompetitionTest, EffectWithTheSameColumnIsEquivalentAndSharesTheProbability) {
  rows.columns["oblique_slip"] = rows.columns["object_push"];
  rows.measured += kHiddenM * rows.columns["object_push"];
  const StepwiseSearch search = Search({"object_push", "oblique_slip", "gravity_sag"});
  const auto steps = FindCompetitors(search, Explained(search), -1, {});
  ASSERT_TRUE(steps.ok() && steps->size() == 1);
  ASSERT_FALSE((*steps)[0].competing.empty());
  EXPECT_TRUE((*steps)[0].competing[0].equivalent);
  EXPECT_EQ((*steps)[0].probability, kCompetitionRules.max_probability.value());
}

TEST_F(CompetitionTest, EffectWithAnotherColumnIsNotEquivalent) {
  rows.measured += kHiddenM * rows.columns["object_push"];
  const StepwiseSearch search = Search({"object_push", "gravity_sag"});
  const auto steps = FindCompetitors(search, Explained(search), -1, {});
  ASSERT_TRUE(steps.ok() && steps->size() == 1);
  EXPECT_EQ((*steps)[0].effect, 0);
  EXPECT_GT((*steps)[0].gain_nats, 50);
  for (const CompetingEffect& other : (*steps)[0].competing) EXPECT_FALSE(other.equivalent) << other.name;
}

// What has no name takes its share of the probability, and is said where it is near.
TEST_F(CompetitionTest, NamelessRivalOfEqualEvidenceHalvesTheProbability) {
  rows.measured += kHiddenM * rows.columns["object_push"];
  const StepwiseSearch search = Search({"object_push"});
  const Explanation whole = Explained(search);
  const auto steps = FindCompetitors(search, whole, -1, {{"object_push", {0, "A course says the same."}}});
  ASSERT_TRUE(steps.ok() && steps->size() == 1);
  EXPECT_NEAR((*steps)[0].probability, 0.5, 1e-6);
  EXPECT_EQ((*steps)[0].words, "A course says the same.");
  const auto far = FindCompetitors(search, whole, -1, {{"object_push", {-20, "A course says the same."}}});
  EXPECT_EQ((*far)[0].probability, kCompetitionRules.max_probability.value());
  EXPECT_EQ((*far)[0].words, "");
}

TEST_F(CompetitionTest, CandidateWithoutANameCountsAndIsNotListed) {
  rows.columns["oblique_slip"] = rows.columns["object_push"];
  rows.measured += kHiddenM * rows.columns["object_push"];
  std::vector<Candidate> candidates = {{effects::Catalogue().Find("object_push")},
                                       {effects::Catalogue().Find("oblique_slip")}};
  candidates[1].nameless = true;
  const StepwiseSearch search(experiment, candidates, SearchRules(), [](const std::string&) {});
  Parameterization start(model::NominalModel(), rows.groups());
  start.Add(candidates[0].effect, false);
  const Explanation whole = {*FitModel(experiment, start), 0};
  const auto steps = FindCompetitors(search, whole, -1, {});
  ASSERT_TRUE(steps.ok() && steps->size() == 1);
  EXPECT_TRUE((*steps)[0].competing.empty());
}

TEST_F(CompetitionTest, ValueOfTheModelThatIsZeroIsSuperfluousAndAnotherIsRefitted) {
  rows.measured += kHiddenM * rows.columns["gravity_sag"];
  model::Model given = model::NominalModel();
  given.effects.push_back({effects::Catalogue().Find("object_push"), false, {kHiddenM}, {}});
  given.effects.push_back({effects::Catalogue().Find("gravity_sag"), false, {2 * kHiddenM}, {}});
  Parameterization free(given, rows.groups());
  free.Free(0, true);
  free.Free(1, true);
  const Fit fit = *FitModel(experiment, free);
  Improvement found;
  const auto superfluous = ImproveValues(experiment, fit, fit, fit.covariance, given, rows.groups(), &found);
  ASSERT_TRUE(superfluous.ok());
  EXPECT_EQ(*superfluous, std::vector<int>{0});
  EXPECT_EQ(found.superfluous, std::vector<std::string>{"object_push"});
  ASSERT_EQ(found.improved.effects.size(), 1u);
  EXPECT_EQ(found.improved.effects[0].effect->name, "gravity_sag");
  EXPECT_TRUE(found.changed && found.values_wrong);
  ASSERT_EQ(found.refitted.size(), 1u);
  EXPECT_EQ(found.refitted[0].effect, "gravity_sag");
  EXPECT_NEAR(*found.refitted[0].parameters[0].before, 2 * kHiddenM * 1e3, 1e-12);
  EXPECT_NEAR(found.refitted[0].parameters[0].value, kHiddenM * 1e3, 0.05);
}

TEST(ExplanationsLeft, AreTheModelAloneWithoutAStep) {
  const ExplanationsLeft left = FindExplanationsLeft({}, {}, model::NominalModel());
  ASSERT_EQ(left.models.size(), 1u);
  EXPECT_EQ(left.models[0].name, "the model as it is");
  EXPECT_FALSE(left.confounded);
}

TEST(WaldP, IsTheTailOfChiSquareInTheKnownDirections) {
  const Eigen::Vector3d difference(2, 1e6, 0);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  covariance(1, 1) = 0;                                             // nothing is known of it
  EXPECT_NEAR(WaldP(difference, covariance), std::exp(-2), 1e-12);  // two degrees of freedom
  EXPECT_EQ(WaldP(difference, Eigen::Matrix3d::Zero()), 1);
}

TEST(WaldP, DoesNotDependOnUnits) {
  const Eigen::Vector2d difference(1, 2);
  Eigen::Matrix2d covariance;
  covariance << 2, 0.5, 0.5, 1;
  const Eigen::Vector2d units(1e-6, 1e3);
  EXPECT_NEAR(WaldP(units.cwiseProduct(difference), units.asDiagonal() * covariance * units.asDiagonal()),
              WaldP(difference, covariance), 1e-9);
}

TEST(ExplainedShare, CountsSquaresBeyondTheNoise) {
  EXPECT_NEAR(ExplainedShare(5, 3, 3), 1, 1e-12);
  EXPECT_NEAR(ExplainedShare(5, 4, 3), 9.0 / 16, 1e-12);
  EXPECT_EQ(ExplainedShare(3, 3, 3), 0);
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
