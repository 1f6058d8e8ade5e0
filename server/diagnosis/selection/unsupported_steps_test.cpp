#include "server/diagnosis/selection/unsupported_steps.h"

#include <gtest/gtest.h>

#include "server/diagnosis/engine/fit/linear_test_model.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kUnsupportedColumn = 50;  // per m

// Two effects in an explanation, of which the rows follow the first.
class UnsupportedStepsTest : public ::testing::Test {
 protected:
  UnsupportedStepsTest() : rows_(4, 25, 2) {
    for (const char* effect : {"object_push", "oblique_slip"})
      rows_.columns[effect] = rows_.Random(rows_.columns.size() + 1, kUnsupportedColumn);
    rows_.measured = rows_.Random(9, 0.005) + 1e-3 * rows_.columns["object_push"];
    likelihood_ = std::make_unique<engine::Likelihood>(rows_.GroupRows(), nullptr, 0, nullptr);
    workspace_.experiment.observations = &rows_;
    workspace_.experiment.likelihood = likelihood_.get();
    engine::Parameterization model(model::NominalModel(), rows_.groups());
    for (const char* effect : {"object_push", "oblique_slip"})
      model.Add(effects::Catalogue().Find(effect), false);
    result_.fit = result_.without_formula = *engine::FitModel(workspace_.experiment, model);
  }
  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const model::EffectInstance& e : result_.fit.model.base().effects) names.push_back(e.effect->name);
    return names;
  }
  engine::LinearTestModel rows_;
  std::unique_ptr<engine::Likelihood> likelihood_;
  Workspace workspace_;
  SelectionResult result_;
};

TEST_F(UnsupportedStepsTest, AnEffectThatPredictsNothingUnseenIsDropped) {
  ASSERT_TRUE(DropUnseen(workspace_, &result_).ok());
  EXPECT_EQ(Names(), std::vector<std::string>{"object_push"});
}

TEST_F(UnsupportedStepsTest, AnEffectThatPredictsTheUnseenStays) {
  rows_.measured += 1e-3 * rows_.columns["oblique_slip"];
  result_.fit = *engine::FitModel(workspace_.experiment, result_.fit.model);
  ASSERT_TRUE(DropUnseen(workspace_, &result_).ok());
  EXPECT_EQ(Names().size(), 2u);
}

TEST_F(UnsupportedStepsTest, BesideARestAnImprobableEffectIsDropped) {
  engine::SelectedStep sure, improbable;
  sure.effect = 0, sure.probability = 0.9;
  improbable.effect = 1, improbable.probability = 1e-6;
  result_.steps = {sure, improbable};
  EXPECT_FALSE(*DropImprobable(workspace_, &result_));  // without a rest other causes compete by name
  result_.curve = NamelessCurve();
  EXPECT_TRUE(*DropImprobable(workspace_, &result_));
  EXPECT_EQ(Names(), std::vector<std::string>{"object_push"});
}

}  // namespace
}  // namespace touchstone::diagnosis::selection
