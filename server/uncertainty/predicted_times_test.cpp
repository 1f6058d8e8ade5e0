// Standard uncertainties against closed forms on a plane that is touched under an angle: finger i at x_i
// travels standoff + x_i tan(tilt), and one on a slope of that angle triggers travel * tan(tilt) later where
// it slips.
#include "server/uncertainty/predicted_times.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "server/base/numbers/matern.h"
#include "server/effects/all_effects.h"
#include "server/uncertainty/budget.h"

namespace touchstone::uncertainty {
namespace {

constexpr double kTilt = 0.2, kSpeed = 0.02;

std::shared_ptr<const geometry::Surface> PlaneOf(const std::string& name) {
  geometry::TriangleMesh mesh;
  mesh.vertices_m = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return *geometry::Surface::Create(name, mesh);
}

Posterior PosteriorWith(const std::string& effects) {
  Posterior posterior;
  posterior.model = *model::ParseModel("touchstone: model/1\nname: fitted\neffects:\n" + effects, "test",
                                       effects::Catalogue());
  posterior.covariance.resize(0, 0);
  return posterior;
}

// One touch of the plane, tilted about y.
TimeUncertainty Predict(const Posterior& posterior, const std::string& object = "plane") {
  const PredictedTimes times(std::make_shared<const Posterior>(posterior));
  PredictedTimes::Workspace workspace;
  TimeUncertainty result;
  const absl::Status status = times.Evaluate(
      [&](const touch::TouchSimulator& simulator, effects::TouchBatch* batch) {
        simulator.Prepare(1, batch);
        batch->surface = PlaneOf(object);
        batch->target_m[0] = {0.01, 0.02, 0};
        batch->approach[0] = {std::sin(kTilt), 0, -std::cos(kTilt)};
        batch->lateral[0] = {std::cos(kTilt), 0, std::sin(kTilt)};
        batch->standoff_m[0] = 0.06;
        batch->speed_m_s[0] = kSpeed;
      },
      &workspace, &result);
  EXPECT_TRUE(status.ok()) << status;
  return result;
}

TEST(PredictedTimes, OfIndependentNoiseLoseWhatTheMeanTakes) {
  const TimeUncertainty u = Predict(PosteriorWith("  - gaussian_noise: {sigma_us: 3000}\n"));
  for (int finger = 0; finger < 3; ++finger) {
    EXPECT_NEAR(u.repeatability_s[finger], 3e-3 * std::sqrt(2.0 / 3), 1e-12);
    EXPECT_DOUBLE_EQ(u.combined_s[finger], u.repeatability_s[finger]);
    EXPECT_EQ(u.parameters_s[finger], 0);
    EXPECT_EQ(u.surface_s[finger], 0);
  }
}

TEST(PredictedTimes, TakeTheRepeatsScatterWhereTheModelHasNoNoise) {
  Posterior posterior = PosteriorWith("  - tool_tilt: {angle_deg: 0}\n");
  posterior.repeatability_s = 2e-3;
  EXPECT_NEAR(Predict(posterior).combined_s[1], 2e-3 * std::sqrt(2.0 / 3), 1e-12);
}

TEST(PredictedTimes, FollowATiltOfTheTool) {
  Posterior posterior = PosteriorWith("  - tool_tilt: {angle_deg: 0.5}\n");
  const double error_rad = 1e-3;
  posterior.values = {{0, 0, 0, "", {}}};
  posterior.covariance = Eigen::MatrixXd::Constant(1, 1, error_rad * error_rad);
  const TimeUncertainty u = Predict(posterior);
  // d_i += x_i tan(angle): 30 mm at the outer fingers, none in the middle.
  EXPECT_NEAR(u.parameters_s[0], 0.03 * error_rad / kSpeed, 1e-3 * 0.03 * error_rad / kSpeed);
  EXPECT_NEAR(u.parameters_s[1], 0, 1e-12);
  EXPECT_NEAR(u.effects_s[0][2], u.parameters_s[2], 1e-15);
}

TEST(PredictedTimes, CountCorrelationsOfValues) {
  // A slower clock and a faster arm undo each other.
  Posterior posterior = PosteriorWith("  - speed_error: {relative: 0}\n  - clock_skew: {relative: 0}\n");
  posterior.values = {{0, 0, 0, "", {}}, {1, 0, 0, "", {}}};
  posterior.covariance.resize(2, 2);
  posterior.covariance << 1e-4, 1e-4, 1e-4, 1e-4;
  const TimeUncertainty together = Predict(posterior);
  posterior.covariance << 1e-4, 0, 0, 1e-4;
  const TimeUncertainty apart = Predict(posterior);
  const double one = 0.03 * std::tan(kTilt) / kSpeed * 1e-2;  // of finger l less the mean
  EXPECT_LT(together.parameters_s[0], 1e-3 * one);
  EXPECT_NEAR(apart.parameters_s[0], std::sqrt(2.0) * one, 2e-4 * one);
  EXPECT_NEAR(apart.effects_s[0][0], one, 2e-4 * one);
}

TEST(PredictedTimes, OfSessionsScatterWithTheirValues) {
  Posterior posterior = PosteriorWith("  - tool_tilt: {angle_deg: 0.5}\n");
  posterior.values = {{0, 0, 0, "", 2e-3}};
  posterior.covariance = Eigen::MatrixXd::Constant(1, 1, 1e-6);
  const TimeUncertainty u = Predict(posterior);
  EXPECT_NEAR(u.reproducibility_s[0], 2 * u.parameters_s[0], 1e-9 * u.parameters_s[0]);
  EXPECT_NEAR(u.combined_s[0], std::sqrt(5.0) * u.parameters_s[0], 1e-9 * u.parameters_s[0]);
}

TEST(PredictedTimes, OfAnUnknownSurfaceShareWhatIsNear) {
  Posterior posterior = PosteriorWith("  - surface_error: {rms_mm: 0.1, length_mm: 20}\n");
  const TimeUncertainty u = Predict(posterior);
  // The contacts lie 30 mm / cos(tilt) apart; a departure h moves a contact by h / cos(tilt) along the
  // approach.
  const double per_m = 1 / (kSpeed * std::cos(kTilt)), apart_m = 0.03 / std::cos(kTilt);
  const double near = Matern52(apart_m, 0.02), far = Matern52(2 * apart_m, 0.02);
  const double mean = (3 + 4 * near + 2 * far) / 9;
  EXPECT_NEAR(u.surface_s[1], 1e-4 * per_m * std::sqrt(1 - 2 * (1 + 2 * near) / 3 + mean), 1e-6);
  EXPECT_NEAR(u.surface_s[0], 1e-4 * per_m * std::sqrt(1 - 2 * (1 + near + far) / 3 + mean), 1e-6);
}

TEST(PredictedTimes, OfAMapKnowItsPointsAndShareWhatLiesFarFromThem) {
  // A point known to 10 um where each finger meets the plane, or far beside it.
  const std::vector<Eigen::Vector3d> contacts =
      Predict(PosteriorWith("  - gaussian_noise: {sigma_us: 1}\n")).contact_m;
  const auto surface_s = [&](double beside_mm) {
    model::SurfaceMapSpec spec;
    spec.file = "map.csv";
    model::SurfaceMapObject& object = spec.objects["plane"];
    object.length_mm = 60, object.rms_mm = 0.1;
    for (const Eigen::Vector3d& contact_m : contacts) {
      const Eigen::Vector3d at_mm = contact_m * 1e3 + Eigen::Vector3d(0, beside_mm, 0);
      object.points.push_back({{at_mm.x(), at_mm.y(), at_mm.z()}, 0, 0.01});
    }
    Posterior posterior = PosteriorWith("  - gaussian_noise: {sigma_us: 1}\n");
    posterior.model.effects.push_back({*effects::MakeSurfaceMapEffect(spec), false, {}, {}});
    return Predict(posterior).surface_s;
  };
  const std::vector<double> unknown_s =
      Predict(PosteriorWith("  - surface_error: {rms_mm: 0.1, length_mm: 60}\n")).surface_s;
  for (int finger = 0; finger < 3; ++finger) {
    // Neighbours are as alike as on any surface of which only the size is known.
    EXPECT_NEAR(surface_s(600)[finger], unknown_s[finger], 0.01 * unknown_s[finger]);
    EXPECT_NEAR(surface_s(0)[finger], 0.1 * unknown_s[finger], 0.01 * unknown_s[finger]);
  }
}

TEST(PredictedTimes, OfAnotherObjectDoNotFollowThisOnesValues) {
  Posterior posterior =
      PosteriorWith("  - object_scale: {scope: object, relative: 0, objects: {sheet: {relative: 0.01}}}\n");
  posterior.values = {{0, 0, 0, "sheet", {}}};
  posterior.covariance = Eigen::MatrixXd::Constant(1, 1, 1e-4);
  EXPECT_EQ(Predict(posterior, "plane").effects_s[0][0], 0);
}

TEST(PredictedTimes, SayWhereNothingWasMeasuredNear) {
  Posterior posterior = PosteriorWith("  - gaussian_noise: {sigma_us: 3000}\n");
  EXPECT_EQ(Predict(posterior).beyond_measured[0], 1);
  const std::vector<Eigen::Vector3d> contacts = Predict(posterior).contact_m;
  posterior.measured["plane"] = {contacts, {3, Eigen::Vector3d::UnitZ()}};
  EXPECT_EQ(Predict(posterior).beyond_measured[0], 0);
  // A tenth of the diagonal of 2.83 m away is near, more is not; and so is a normal of more than 30 deg.
  posterior.measured["plane"] = {{contacts[0] + Eigen::Vector3d(0, 0.4, 0)}, {Eigen::Vector3d::UnitZ()}};
  EXPECT_EQ(Predict(posterior).beyond_measured[0], 1);
  posterior.measured["plane"] = {contacts, {3, Eigen::Vector3d(0.6, 0, 0.8)}};
  EXPECT_EQ(Predict(posterior).beyond_measured[0], 1);
}

TEST(Budget, AddsVariancesObjectByObject) {
  Posterior posterior =
      PosteriorWith("  - gaussian_noise: {sigma_us: 3000}\n  - tool_tilt: {angle_deg: 0.5}\n");
  posterior.values = {{1, 0, 0, "", {}}};
  posterior.covariance = Eigen::MatrixXd::Constant(1, 1, 4e-6);
  const PredictedTimes times(std::make_shared<const Posterior>(posterior));
  BudgetSum sum(times);
  sum.Add("b", Predict(posterior));
  sum.Add("a", Predict(posterior));
  const std::vector<Budget> budgets = sum.Budgets();
  ASSERT_EQ(budgets.size(), 3);
  EXPECT_EQ(budgets[0].object, "a");
  EXPECT_EQ(budgets[2].object, "");
  EXPECT_EQ(budgets[2].touches, 2);
  EXPECT_EQ(budgets[2].beyond_measured, 2);
  EXPECT_NEAR(budgets[0].parameters, 0.03 * 2e-3 / kSpeed * std::sqrt(2.0 / 3), 1e-6);
  EXPECT_NEAR(std::pow(budgets[0].combined, 2), std::pow(budgets[0].parameters, 2) + 9e-6 * 2 / 3, 1e-12);
  EXPECT_FALSE(budgets[0].reproducibility.has_value());
  EXPECT_EQ(budgets[0].contributions[0].name, "tool_tilt");
}

}  // namespace
}  // namespace touchstone::uncertainty
