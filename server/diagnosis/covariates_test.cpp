// A variable of an expression means the same wherever a model is used: a set that a model has made is compared with that
// model, and nothing is left.
#include <gtest/gtest.h>

#include "server/diagnosis/diagnose.h"
#include "server/diagnosis/touches/simulated_test_set.h"
#include "server/effects/formula/formula.h"

namespace touchstone::diagnosis {
namespace {

// RMSE, us, of a noiseless set under the effects of its own rig (`with`), or without them.
double ComparedRmse(touches::HiddenRig rig, bool with) {
  DiagnosisInput input = touches::MakeTestInput(rig);
  model::Model model = model::NominalModel();
  if (with) model = touches::WithEffects(std::move(model), rig.hidden);
  input.model = std::make_shared<const model::Model>(std::move(model));
  const absl::StatusOr<report::Diagnosis> compared = Compare(input, {});
  EXPECT_TRUE(compared.ok()) << compared.status();
  return compared.ok() ? compared->data[0].initial->rmse : NAN;
}

touches::HiddenRig NoiselessRig() {
  touches::HiddenRig rig;
  rig.objects = {"lat05", "lat15"};
  rig.samples_per_face = 2;
  rig.rounds = 2;
  rig.sigma_us = 0;
  return rig;
}

void ExpectTheModelExplainsItsOwnSet(const std::vector<std::string>& values, const std::string& effect) {
  touches::HiddenRig rig = NoiselessRig();
  rig.hidden = {{effect, values}};
  EXPECT_GT(ComparedRmse(rig, false), 1);
  EXPECT_LT(ComparedRmse(rig, true), 1e-3);
}

TEST(Covariates, OfAFormulaMeanTheSameInTouchesAndComparisons) {
  for (const effects::FormulaVariable& variable : effects::FormulaVariables()) {
    for (const char* adds : {"travel_mm", "time_us"}) {
      SCOPED_TRACE(std::string(variable.name) + " adds " + adds);
      // Whatever all fingers share shows only where it differs between them.
      const std::string term = "(1 + finger) * sin(" + std::string(variable.name) + " + 1)";
      const std::string scale = std::string(adds) == "travel_mm" ? "0.1" : "5000";
      ExpectTheModelExplainsItsOwnSet(
          {"name=hidden", std::string("adds=") + adds, "expression=" + scale + " * " + term}, "formula");
    }
  }
}

TEST(Covariates, OfACurveMeanTheSameInTouchesAndComparisons) {
  for (const effects::FormulaVariable& variable : effects::FormulaVariables()) {
    SCOPED_TRACE(variable.name);
    ExpectTheModelExplainsItsOwnSet(
        {"name=hidden", "adds=travel_mm", std::string("covariate=") + variable.name, "knots=-1,0,1,40",
         "l=0,0.1,0.3,0.8", "m=0,0,0,0.1", "r=0,0.2,0.1,0"},
        "lookup");
  }
}

}  // namespace
}  // namespace touchstone::diagnosis
