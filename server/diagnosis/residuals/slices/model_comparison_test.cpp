#include "server/diagnosis/residuals/slices/model_comparison.h"

#include <gtest/gtest.h>

#include "server/diagnosis/touches/simulated_test_set.h"

namespace touchstone::diagnosis::residuals {
namespace {

constexpr double kCompareSigmaS = 0.002;

struct Compared {
  touches::Observations observations;
  ModelDifference difference;
};

// A rig that is 2 % too fast: the nominal model against one of another speed.
Compared Against(const std::string& relative, uint64_t seed = 1) {
  touches::HiddenRig rig;
  rig.samples_per_face = 8;
  rig.hidden = {{"speed_error", {"relative=0.02"}}};
  auto observations = touches::MakeObservations(touches::MakeTestInput(rig));
  EXPECT_TRUE(observations.ok()) << observations.status();
  Compared compared{*std::move(observations), {}};
  const auto predict = [&](const model::Model& model) {
    return *touches::Predict(compared.observations, model, true, true, nullptr);
  };
  const model::Model nominal = model::NominalModel();
  compared.difference =
      CompareModels(compared.observations, predict(nominal),
                    predict(touches::WithEffects(nominal, {{"speed_error", {"relative=" + relative}}})),
                    kCompareSigmaS, seed);
  return compared;
}

TEST(CompareModels, TheTruthErrsLessInEveryDraw) {
  const ModelDifference d = Against("0.02").difference;
  EXPECT_NEAR(d.other_rmse_s, kCompareSigmaS, 0.1 * kCompareSigmaS);
  EXPECT_DOUBLE_EQ(d.difference_s, d.other_rmse_s - d.rmse_s);
  EXPECT_EQ(d.other_better, 1);
  EXPECT_LT(d.lower_s, d.difference_s);
  EXPECT_GT(d.upper_s, d.difference_s);
  EXPECT_LT(d.upper_s, 0);
  EXPECT_FALSE(d.better.empty());
  EXPECT_TRUE(d.worse.empty());
}

TEST(CompareModels, NearlyTheSameModelIsNotSaidToErrLess) {
  const ModelDifference d = Against("0.000001").difference;
  EXPECT_LT(std::abs(d.difference_s), 1e-5);
}

TEST(CompareModels, ASpeedThatIsFartherOffIsWorse) {
  const ModelDifference d = Against("0.06").difference;
  EXPECT_GT(d.lower_s, 0);
  EXPECT_EQ(d.other_better, 0);
  EXPECT_FALSE(d.worse.empty());
}

TEST(CompareModels, TheTouchesThatDecideComeWithTheirResiduals) {
  const Compared compared = Against("0.02");
  const ModelDifference& d = compared.difference;
  ASSERT_EQ(d.deciding.size(), 10u);
  for (size_t n = 1; n < d.deciding.size(); ++n)
    EXPECT_GE(std::abs(d.deciding[n - 1].fall), std::abs(d.deciding[n].fall));
  EXPECT_GT(std::abs(d.deciding[0].before_s), std::abs(d.deciding[0].after_s));
}

TEST(CompareModels, TheSameSeedGivesTheSameInterval) {
  EXPECT_EQ(Against("0.02", 7).difference.lower_s, Against("0.02", 7).difference.lower_s);
}

}  // namespace
}  // namespace touchstone::diagnosis::residuals
