#include "server/effects/contact/smooth_field.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/numbers/random.h"

namespace touchstone::effects {
namespace {

TEST(SmoothField, HasTheMaternCovariance) {
  const std::vector<double> ratios = {0.0, 0.5, 1.0, 2.0};  // distance over length
  constexpr int kFields = 4000;
  constexpr double kLengthM = 0.02;
  const Eigen::Vector3d a(0.01, -0.02, 0.03);
  std::vector<double> covariance(ratios.size(), 0.0);
  for (int seed = 0; seed < kFields; ++seed) {
    const SmoothField field(seed, 5, kLengthM, {});
    for (size_t i = 0; i < ratios.size(); ++i)
      covariance[i] +=
          field.At(a) * field.At(a + ratios[i] * kLengthM * Eigen::Vector3d(1, 2, -2) / 3) / kFields;
  }
  // (1 + r + r^2 / 3) exp(-r), r = sqrt(5) distance / length; the mean of 4000 products errs by 0.02.
  for (size_t i = 0; i < ratios.size(); ++i) {
    const double r = std::sqrt(5.0) * ratios[i];
    EXPECT_NEAR(covariance[i], (1 + r + r * r / 3) * std::exp(-r), 0.08) << ratios[i] << " lengths apart";
  }
}

TEST(SmoothField, HasRmsOneOverItsPoints) {
  RandomStream random(1, RandomDomain::kTest);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 500; ++i)
    points.emplace_back(random.Uniform(-0.1, 0.1), random.Uniform(-0.1, 0.1), random.Uniform(-0.1, 0.1));
  const SmoothField field(2, 3, 0.05, points);
  double sum = 0;
  for (const Eigen::Vector3d& point : points) sum += field.At(point) * field.At(point);
  EXPECT_NEAR(sum / points.size(), 1, 1e-12);
}

TEST(SmoothField, IsSmooth) {
  const SmoothField field(2, 3, 0.02, {});
  // Steps of 10 um on a straight line of 0.2 m: no step and no kink anywhere. The slope of a Matern-5/2 field
  // has the RMS sqrt(5 / 3) / length; five times that is never reached.
  const double step_m = 1e-5;
  double previous = field.At(Eigen::Vector3d(-0.1, 0.03, 0.01));
  for (int i = 1; i < 20000; ++i) {
    const double value = field.At(Eigen::Vector3d(-0.1 + i * step_m, 0.03, 0.01));
    ASSERT_LT(std::fabs(value - previous), 5 * std::sqrt(5.0 / 3) / 0.02 * step_m) << "at step " << i;
    previous = value;
  }
}

TEST(SmoothField, IsAPureFunctionOfSeedObjectAndLength) {
  const Eigen::Vector3d point(0.01, 0.02, 0.03);
  EXPECT_EQ(SmoothField(2, 3, 0.02, {}).At(point), SmoothField(2, 3, 0.02, {}).At(point));
  EXPECT_NE(SmoothField(2, 3, 0.02, {}).At(point), SmoothField(2, 4, 0.02, {}).At(point));
  EXPECT_NE(SmoothField(2, 3, 0.02, {}).At(point), SmoothField(1, 3, 0.02, {}).At(point));
}

}  // namespace
}  // namespace touchstone::effects
