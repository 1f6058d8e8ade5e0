#include "server/diagnosis/images/photo_budget.h"

#include <gtest/gtest.h>

#include "server/diagnosis/engine/fit/parameterization.h"
#include "server/diagnosis/images/photo_test_set.h"

namespace touchstone::diagnosis::images {
namespace {

// What a distortion that is known to `k1_error` and `k2_error` leaves open of a pixel, grey levels.
double LeftOpenByDistortion(double k1_error, double k2_error) {
  HiddenCamera rig;
  rig.photographs = 2;
  rig.known = {{"radial_distortion", {"k1=-0.15"}}};
  const DiagnosisInput input = MakePhotoInput(rig);
  const absl::StatusOr<Photographs> photographs = MakePhotographs(input, nullptr);
  EXPECT_TRUE(photographs.ok()) << photographs.status();
  engine::Fit fit;
  fit.model = engine::Parameterization(*input.model, photographs->objects);
  for (size_t e = 0; e < input.model->effects.size(); ++e)
    if (input.model->effects[e].effect->name == "radial_distortion")
      fit.model.Free(static_cast<int>(e), true);
  fit.point = fit.model.Start();
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(2, 2);
  covariance.diagonal() << k1_error * k1_error, k2_error * k2_error;
  const auto budgets = BudgetOfPhotographs(*photographs, fit, covariance, *input.model, 2, nullptr);
  EXPECT_TRUE(budgets.ok()) << budgets.status();
  return budgets.ok() ? budgets->back().parameters : 0;
}

// A contour that is sampled at pixel centres changes by whole pixels: their share grows as the root of what moves it.
TEST(BudgetOfPhotographs, GrowsAsTheErrorOfWhatMovesContours) {
  const double small = LeftOpenByDistortion(2e-5, 2e-5), large = LeftOpenByDistortion(2e-3, 2e-3);
  EXPECT_GT(small, 0);
  EXPECT_NEAR(large / small, 100, 10);
}

}  // namespace
}  // namespace touchstone::diagnosis::images
