#include "server/diagnosis/engine/fit/parameterization.h"

#include <gtest/gtest.h>

#include "server/effects/all_effects.h"

namespace touchstone::diagnosis::engine {
namespace {

model::Model With(const std::string& effect, const std::vector<std::string>& values) {
  return *model::AddEffect(model::NominalModel(), effect, values, effects::Catalogue());
}

TEST(Parameterization, StandsWhereItsBaseStands) {
  Parameterization model(With("finger_length", {"offset_mm=0.3,-0.1,-0.2"}), {"lat00"});
  model.Free(0, true);
  EXPECT_EQ(model.size(), 2);  // three values that sum to zero
  const model::Model again = model.At(model.Start());
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(again.effects[0].values[i], model.base().effects[0].values[i], 1e-12);
}

TEST(Parameterization, KeepsTheSumOfZeroWhereverItMoves) {
  Parameterization model(model::NominalModel(), {});
  model.Add(effects::Catalogue().Find("channel_latency"), false);
  const model::Model moved = model.At(Eigen::Vector2d(0.001, -0.004));
  EXPECT_NEAR(moved.effects[0].values[0] + moved.effects[0].values[1] + moved.effects[0].values[2], 0, 1e-15);
}

TEST(Parameterization, GivesEveryObjectItsOwnValues) {
  Parameterization model(model::NominalModel(), {"a", "b"});
  model.Add(effects::Catalogue().Find("object_scale"), true);
  ASSERT_EQ(model.size(), 2);
  const model::Model moved = model.At(Eigen::Vector2d(0.01, -0.02));
  EXPECT_NEAR(moved.effects[0].ValuesFor("a")[0], 0.01, 1e-15);
  EXPECT_NEAR(moved.effects[0].ValuesFor("b")[0], -0.02, 1e-15);
}

TEST(Parameterization, ActsOnOneObjectAndLeavesTheOthersAlone) {
  Parameterization model(model::NominalModel(), {"a", "b", "c"});
  model.AddOn(effects::Catalogue().Find("object_push"), "b");
  ASSERT_EQ(model.size(), 1);
  EXPECT_EQ(model.OnlyObject(0), "b");
  const model::Model moved = model.At(Eigen::VectorXd::Constant(1, 0.002));
  EXPECT_NEAR(moved.effects[0].ValuesFor("b")[0], 0.002, 1e-15);
  EXPECT_EQ(moved.effects[0].ValuesFor("a")[0], 0);
  EXPECT_EQ(moved.effects[0].ValuesFor("c")[0], 0);
  const auto values = model.Describe(0, Eigen::VectorXd::Constant(1, 0.002), Eigen::MatrixXd());
  ASSERT_EQ(values.size(), 1u);
  EXPECT_EQ(values[0].object, "b");
}

TEST(Parameterization, PaysForTheChoiceOfAnObject) {
  Parameterization model(model::NominalModel(), {"a", "b", "c", "d"});
  model.AddOn(effects::Catalogue().Find("finger_length"), "b");
  double log_prior = 0;
  for (const FreeParameter& p : model.parameters()) log_prior += p.log_prior;
  EXPECT_NEAR(log_prior, -std::log(4), 1e-12);
}

TEST(Parameterization, AnEffectWithAValueForEachObjectActsOnMoreThanOne) {
  Parameterization model(model::NominalModel(), {"a", "b"});
  model.Add(effects::Catalogue().Find("object_push"), true);
  EXPECT_EQ(model.OnlyObject(0), "");
}

TEST(Parameterization, HoldsValuesWithinTheirBounds) {
  Parameterization model(model::NominalModel(), {});
  model.Add(effects::Catalogue().Find("tip_radius"), false);
  Eigen::VectorXd below(1);
  below << -1;
  EXPECT_EQ(model.At(below).effects[0].values[0], 0);
}

TEST(Parameterization, TurnsTheRampsInfinityIntoZero) {
  Parameterization model(model::NominalModel(), {});
  model.Add(effects::Catalogue().Find("acceleration_ramp"), false);
  EXPECT_NEAR(model.Start()[0], 0, 1e-2);
  Eigen::VectorXd point(1);
  point << 50;  // s^2 / m
  EXPECT_NEAR(model.At(point).effects[0].values[0], 0.02, 1e-12);
}

TEST(Parameterization, TellsValuesWithErrorsInTheUnitsOfFiles) {
  Parameterization model(model::NominalModel(), {});
  model.Add(effects::Catalogue().Find("tip_radius"), false);
  Eigen::VectorXd point(1);
  point << 1.5e-3;
  const auto values = model.Describe(0, point, Eigen::MatrixXd::Constant(1, 1, 1e-10));
  ASSERT_EQ(values.size(), 1u);
  EXPECT_EQ(values[0].name, "radius_mm");
  EXPECT_NEAR(values[0].value, 1.5, 1e-9);
  EXPECT_NEAR(values[0].std_error, 0.01, 1e-9);
  EXPECT_NEAR(values[0].upper - values[0].lower, 2 * 1.96 * 0.01, 1e-4);
}

TEST(Parameterization, WithoutAnEffectKeepsTheOthersParameters) {
  Parameterization model(model::NominalModel(), {});
  model.Add(effects::Catalogue().Find("tool_tilt"), false);
  model.Add(effects::Catalogue().Find("tip_radius"), false);
  const Parameterization rest = model.Without(0);
  ASSERT_EQ(rest.size(), 1);
  EXPECT_EQ(rest.base().effects[rest.parameters()[0].effect].effect->name, "tip_radius");
}

}  // namespace
}  // namespace touchstone::diagnosis::engine
