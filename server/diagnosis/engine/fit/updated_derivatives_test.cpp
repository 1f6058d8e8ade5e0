// Fits whose derivatives are updated by what the last step changed (Experiment::update_derivatives).
#include <gtest/gtest.h>

#include <cmath>

#include "server/diagnosis/engine/fit/fit.h"
#include "server/diagnosis/engine/fit/linear_test_model.h"
#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::engine {
namespace {

constexpr double kPerUnit = 50;          // size of a column, per m or rad
constexpr double kHiddenValue = 0.8e-3;  // m or rad

// Counts how often rows are predicted.
class CountedRows : public LinearTestModel {
 public:
  using LinearTestModel::LinearTestModel;
  absl::StatusOr<std::vector<double>> Predict(const model::Model& model) const override {
    ++predictions;
    return LinearTestModel::Predict(model);
  }
  mutable int predictions = 0;
};

class UpdatedDerivativesTest : public ::testing::Test {
 protected:
  UpdatedDerivativesTest() : counted(4, 25, 2) {
    counted.columns["object_push"] = counted.Random(1, kPerUnit);
    counted.columns["tool_tilt"] = counted.Random(2, kPerUnit);
    counted.measured = counted.Random(3, 0.005);
    likelihood = std::make_unique<Likelihood>(counted.GroupRows(), nullptr, 0, nullptr);
    experiment.observations = &counted;
    experiment.likelihood = likelihood.get();
  }
  Parameterization Free(const std::vector<std::string>& effects) const {
    Parameterization model(model::NominalModel(), counted.groups());
    for (const std::string& effect : effects) model.Add(effects::Catalogue().Find(effect), false);
    return model;
  }
  CountedRows counted;
  std::unique_ptr<Likelihood> likelihood;
  Experiment experiment;
};

// Three effects whose response is far from linear, fitted with derivatives that are updated and without.
TEST_F(UpdatedDerivativesTest, LeadToTheSameOptimumWithFewerPredictions) {
  counted.columns["gravity_sag"] = counted.Random(4, kPerUnit);
  counted.bend = 500;
  for (const auto& [effect, column] : counted.columns)
    counted.measured += column * (kHiddenValue + counted.bend * kHiddenValue * kHiddenValue);
  const Parameterization start = Free({"object_push", "tool_tilt", "gravity_sag"});
  const Fit simulated = *FitModel(experiment, start);
  const int predictions = counted.predictions;
  experiment.update_derivatives = true;
  counted.predictions = 0;
  const Fit updated = *FitModel(experiment, start);
  EXPECT_LT(counted.predictions, predictions);
  for (int i = 0; i < start.size(); ++i)
    EXPECT_NEAR(updated.point[i], simulated.point[i], 0.1 * std::sqrt(simulated.covariance(i, i))) << i;
  EXPECT_NEAR(updated.log_evidence, simulated.log_evidence, 0.05);
}

TEST_F(UpdatedDerivativesTest, OfAPartAreTakenOverWhereTheRestChangesNothing) {
  counted.measured += kHiddenValue * counted.columns["object_push"];
  experiment.update_derivatives = true;
  const Fit part = *FitModel(experiment, Free({"object_push"}));
  Parameterization start = part.model;
  start.Add(effects::Catalogue().Find("tool_tilt"), false);
  counted.predictions = 0;
  ASSERT_TRUE(FitModel(experiment, start, 0, &part).ok());
  EXPECT_EQ(counted.predictions, 2);  // the start, and one derivative
  Eigen::VectorXd moved = start.Start();
  moved[1] = start.parameters()[1].scale;
  start.MoveTo(moved);
  counted.predictions = 0;
  ASSERT_TRUE(FitModel(experiment, start, 0, &part).ok());
  EXPECT_EQ(counted.predictions, 3);
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
