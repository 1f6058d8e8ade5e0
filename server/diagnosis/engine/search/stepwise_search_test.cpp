#include "server/diagnosis/engine/search/stepwise_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/diagnosis/engine/fit/linear_test_model.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::engine {
namespace {

constexpr double kSearchSigma = 0.005;
constexpr double kSearchColumn = 50;  // per m
constexpr double kSearchPushM = 0.8e-3;
constexpr double kSearchDeadM = 0.5e-3;

class StepwiseSearchTest : public ::testing::Test {
 protected:
  StepwiseSearchTest() : rows(4, 25, 2) {
    for (const char* effect : {"object_push", "oblique_slip", "gravity_sag"}) {
      rows.columns[effect] = rows.Random(rows.columns.size() + 1, kSearchColumn);
      candidates.push_back({effects::Catalogue().Find(effect), false, false, {}});
    }
    rows.measured = rows.Random(9, kSearchSigma);
    likelihood = std::make_unique<Likelihood>(rows.GroupRows(), nullptr, 0, nullptr);
    experiment.observations = &rows;
    experiment.likelihood = likelihood.get();
  }
  StepwiseSearch Search() const {
    return {experiment, candidates, SearchRules(), [](const std::string&) {}};
  }
  Parameterization Nominal() const { return {model::NominalModel(), rows.groups()}; }
  static std::vector<std::string> Names(const Fit& fit) {
    std::vector<std::string> names;
    for (const model::EffectInstance& instance : fit.model.base().effects)
      names.push_back(instance.effect->name);
    return names;
  }
  LinearTestModel rows;
  std::vector<Candidate> candidates;
  std::unique_ptr<Likelihood> likelihood;
  Experiment experiment;
};

TEST_F(StepwiseSearchTest, AddsNothingToNoise) {
  EXPECT_TRUE(Names(Search().Run(Nominal(), 0)->fit).empty());
}

TEST_F(StepwiseSearchTest, AddsTheEffectThatTheRowsFollow) {
  rows.measured += kSearchPushM * rows.columns["object_push"];
  const Explanation explanation = *Search().Run(Nominal(), 0);
  ASSERT_EQ(Names(explanation.fit), std::vector<std::string>{"object_push"});
  EXPECT_NEAR(explanation.fit.point[0], kSearchPushM, 4 * std::sqrt(explanation.fit.covariance(0, 0)));
}

// What happened to one group looks most like a push, which the others contradict.
TEST_F(StepwiseSearchTest, AddsTheNextWhereTheBestFailsOnRowsThatItDidNotSee) {
  rows.measured += kSearchPushM * rows.columns["oblique_slip"];
  rows.measured.segment(0, 50) += 6 * kSearchPushM * rows.columns["object_push"].segment(0, 50);
  const StepwiseSearch search = Search();
  const std::vector<Extension> extensions = *search.Score(*FitModel(experiment, Nominal()), 0);
  ASSERT_GT(extensions[0].log_evidence, extensions[1].log_evidence);
  EXPECT_EQ(Names(search.Run(Nominal(), 0)->fit), std::vector<std::string>{"oblique_slip"});
}

// One effect takes away what the other adds, but for a twentieth of it.
TEST_F(StepwiseSearchTest, AddsTwoOfWhichNeitherShowsWithoutTheOther) {
  rows.columns["oblique_slip"] = rows.Random(20, 0.05 * kSearchColumn) - rows.columns["object_push"];
  rows.measured += 4 * kSearchPushM * (rows.columns["object_push"] + rows.columns["oblique_slip"]);
  const StepwiseSearch search = Search();
  const Fit nominal = *FitModel(experiment, Nominal());
  std::vector<PairOfExtensions> pairs;
  for (const Extension& extension : *search.Score(nominal, 0, &pairs))
    EXPECT_LT(extension.log_evidence, nominal.log_evidence + SearchRules().enter_nats) << extension.name;
  ASSERT_EQ(pairs.size(), 3u);
  EXPECT_GT(pairs[0].log_evidence, nominal.log_evidence + 2 * SearchRules().enter_nats);
  std::vector<std::string> names = Names(search.Run(Nominal(), 0)->fit);
  std::sort(names.begin(), names.end());
  EXPECT_EQ(names, (std::vector<std::string>{"object_push", "oblique_slip"}));
}

TEST_F(StepwiseSearchTest, RemovesAnEffectThatTwoOthersMakeSuperfluous) {
  // The third column looks like the sum of the first two, which are the causes.
  rows.columns["gravity_sag"] =
      rows.columns["object_push"] + rows.columns["oblique_slip"] + rows.Random(20, 0.8 * kSearchColumn);
  rows.measured += kSearchPushM * (rows.columns["object_push"] + rows.columns["oblique_slip"]);
  std::vector<std::string> names = Names(Search().Run(Nominal(), 0)->fit);
  std::sort(names.begin(), names.end());
  EXPECT_EQ(names, (std::vector<std::string>{"object_push", "oblique_slip"}));
}

TEST_F(StepwiseSearchTest, PredictsTheEvidenceOfALinearExtension) {
  rows.measured += kSearchPushM * rows.columns["oblique_slip"];
  const StepwiseSearch search = Search();
  const Fit nominal = *FitModel(experiment, Nominal());
  const std::vector<Extension> extensions = *search.Score(nominal, 0);
  ASSERT_EQ(extensions.size(), 3u);
  for (const Extension& extension : extensions) {
    EXPECT_TRUE(extension.visible);
    EXPECT_NEAR(extension.log_evidence, search.FitExtension(extension)->log_evidence, 0.1) << extension.name;
  }
  EXPECT_GT(extensions[1].log_evidence, nominal.log_evidence + 50);
}

TEST_F(StepwiseSearchTest, SaysWhatTheRowsCannotSee) {
  rows.columns["gravity_sag"].setZero();
  const std::vector<Extension> extensions = *Search().Score(*FitModel(experiment, Nominal()), 0);
  EXPECT_FALSE(extensions[2].visible);
  EXPECT_TRUE(extensions[0].visible);
}

// A ramp that ends before the usual contacts: the slope where it changes nothing is zero.
TEST_F(StepwiseSearchTest, FindsAnEffectThatShowsOnlyFromASizeOn) {
  rows.dead = kSearchDeadM;
  rows.measured += kSearchPushM * rows.columns["object_push"];
  const StepwiseSearch search = Search();
  const std::vector<Extension> extensions = *search.Score(*FitModel(experiment, Nominal()), 0);
  EXPECT_FALSE(extensions[0].visible);
  ASSERT_TRUE(extensions[0].Acts());
  const Explanation explanation = *search.Run(Nominal(), 0);
  ASSERT_EQ(Names(explanation.fit), std::vector<std::string>{"object_push"});
  EXPECT_NEAR(explanation.fit.point[0], kSearchDeadM + kSearchPushM,
              4 * std::sqrt(explanation.fit.covariance(0, 0)));
}

TEST_F(StepwiseSearchTest, AnEffectThatShowsOnlyFromASizeOnIsNotAddedToNoise) {
  rows.dead = kSearchDeadM;
  EXPECT_TRUE(Names(Search().Run(Nominal(), 0)->fit).empty());
}

TEST_F(StepwiseSearchTest, AnEffectWithTheSameColumnCompetesWithEqualEvidence) {
  rows.columns["gravity_sag"] = rows.columns["oblique_slip"];
  rows.measured += kSearchPushM * rows.columns["oblique_slip"];
  const StepwiseSearch search = Search();
  const Explanation explanation = *search.Run(Nominal(), 0);
  ASSERT_EQ(explanation.fit.model.base().effects.size(), 1u);
  const std::vector<CompetingFit> competing = *search.CompetingFits(explanation, 0);
  ASSERT_GE(competing.size(), 2u);
  EXPECT_EQ(competing[0].name, Names(explanation.fit)[0]);
  EXPECT_NE(competing[1].name, competing[0].name);
  EXPECT_NEAR(competing[1].fit.log_likelihood, competing[0].fit.log_likelihood, 0.1);
}

// The test's effects, each also on one group and with a value for every group.
std::vector<Candidate> WithGroups(const std::vector<Candidate>& candidates,
                                  const std::vector<std::string>& groups) {
  std::vector<Candidate> all;
  for (const Candidate& candidate : candidates) {
    all.push_back(candidate);
    Candidate other = candidate;
    other.per_object = other.rare = true;
    all.push_back(other);
    for (const std::string& group : groups) {
      other.object = group;
      all.push_back(other);
    }
  }
  return all;
}

TEST_F(StepwiseSearchTest, FindsAnEffectThatActsOnOneGroupOnly) {
  rows.measured.segment(50, 50) += kSearchPushM * rows.columns["oblique_slip"].segment(50, 50);
  candidates = WithGroups(candidates, rows.groups());
  const Explanation explanation = *Search().Run(Nominal(), 0);
  ASSERT_EQ(Names(explanation.fit), std::vector<std::string>{"oblique_slip"});
  EXPECT_EQ(explanation.fit.model.OnlyObject(0), "b");
  EXPECT_NEAR(explanation.fit.point[0], kSearchPushM, 4 * std::sqrt(explanation.fit.covariance(0, 0)));
}

TEST_F(StepwiseSearchTest, AnEffectOfEveryGroupIsNotCalledOneOfASingleGroup) {
  rows.measured += kSearchPushM * rows.columns["oblique_slip"];
  candidates = WithGroups(candidates, rows.groups());
  const Explanation explanation = *Search().Run(Nominal(), 0);
  ASSERT_EQ(Names(explanation.fit), std::vector<std::string>{"oblique_slip"});
  EXPECT_FALSE(explanation.fit.model.base().effects[0].per_object);
}

TEST_F(StepwiseSearchTest, FindsAnEffectThatDiffersFromGroupToGroup) {
  const double values_m[] = {0.4e-3, 2e-3, 0.2e-3, 3e-3};
  for (int g = 0; g < 4; ++g)
    rows.measured.segment(50 * g, 50) += values_m[g] * rows.columns["oblique_slip"].segment(50 * g, 50);
  candidates = WithGroups(candidates, rows.groups());
  const Explanation explanation = *Search().Run(Nominal(), 0);
  ASSERT_EQ(Names(explanation.fit), std::vector<std::string>{"oblique_slip"});
  ASSERT_EQ(explanation.fit.model.size(), 4);
  for (int g = 0; g < 4; ++g)
    EXPECT_NEAR(explanation.fit.point[g], values_m[g], 4 * std::sqrt(explanation.fit.covariance(g, g)));
}

TEST_F(StepwiseSearchTest, ScoresEffectsByGroupAsAFitFindsThem) {
  rows.measured.segment(100, 50) += kSearchPushM * rows.columns["gravity_sag"].segment(100, 50);
  candidates = WithGroups(candidates, rows.groups());
  const StepwiseSearch search = Search();
  const std::vector<Extension> extensions = *search.Score(*FitModel(experiment, Nominal()), 0);
  ASSERT_EQ(extensions.size(), 18u);
  for (const Extension& extension : extensions)
    EXPECT_NEAR(extension.log_evidence, search.FitExtension(extension)->log_evidence, 0.1)
        << extension.name << " " << extension.object;
}

TEST_F(StepwiseSearchTest, SetsAValueOfTheInitialModelFreeWhereItIsWrong) {
  rows.measured += kSearchPushM * rows.columns["object_push"];
  const model::Model model =
      *model::AddEffect(model::NominalModel(), "object_push", {"shift_mm=0.4"}, effects::Catalogue());
  const Explanation explanation = *Search().Run({model, rows.groups()}, 1);
  EXPECT_EQ(Names(explanation.fit), std::vector<std::string>{"object_push"});
  ASSERT_TRUE(explanation.fit.model.IsFree(0));
  EXPECT_NEAR(explanation.fit.point[0], kSearchPushM, 4 * std::sqrt(explanation.fit.covariance(0, 0)));
}

TEST_F(StepwiseSearchTest, AddsNothingOnWhichPartsDoNotAgreeWhereThatIsAsked) {
  rows.columns["object_push"].tail(150) *= 0.1;  // nearly all of the gain is the first group's
  rows.measured += kSearchPushM * rows.columns["object_push"];
  EXPECT_EQ(Names(Search().Run(Nominal(), 0)->fit), std::vector<std::string>{"object_push"});
  SearchRules rules;
  rules.min_cv_gain_std_errors = 2;
  const StepwiseSearch strict(experiment, candidates, rules, [](const std::string&) {});
  EXPECT_TRUE(Names(strict.Run(Nominal(), 0)->fit).empty());
  rows.columns["object_push"].tail(150) *= 10;
  rows.measured = rows.Random(9, kSearchSigma) + kSearchPushM * rows.columns["object_push"];
  EXPECT_EQ(Names(strict.Run(Nominal(), 0)->fit), std::vector<std::string>{"object_push"});
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
