#include "server/effects/contact/smooth_field.h"

#include <cmath>

#include "server/base/numbers/random.h"
#include "server/base/units.h"

namespace touchstone::effects {

SmoothField::SmoothField(uint64_t seed, uint64_t object_id, double length_m,
                         absl::Span<const Eigen::Vector3d> points_m) {
  RandomStream random(seed, RandomDomain::kSurfaceField, object_id);
  const int lanes = Lanes::RowsAtCompileTime;
  for (auto& axis : turns_per_m_) axis.resize(kFeatures / lanes);
  phase_turns_.resize(kFeatures / lanes);
  for (int feature = 0; feature < kFeatures; ++feature) {
    // The spectrum of Matern-5/2 is a multivariate t distribution with 5 degrees of freedom.
    Eigen::Vector3d direction;
    for (int axis = 0; axis < 3; ++axis) direction[axis] = random.Normal();
    double chi_squared = 0;
    for (int degree = 0; degree < 5; ++degree) {
      const double z = random.Normal();
      chi_squared += z * z;
    }
    const Eigen::Vector3d wave = direction * (std::sqrt(5.0 / chi_squared) / (length_m * 2 * kPi));
    for (int axis = 0; axis < 3; ++axis) turns_per_m_[axis][feature / lanes][feature % lanes] = wave[axis];
    phase_turns_[feature / lanes][feature % lanes] = random.Uniform();
  }

  // Over all phases a cosine has a mean square of one half.
  scale_ = std::sqrt(2.0 / kFeatures);
  double sum = 0;
  for (const Eigen::Vector3d& point : points_m) sum += At(point) * At(point);
  if (sum > 0) scale_ /= std::sqrt(sum / points_m.size());
}

double SmoothField::At(const Eigen::Vector3d& point_m) const {
  Lanes sum = Lanes::Zero();
  for (size_t k = 0; k < phase_turns_.size(); ++k) {
    const Lanes turns = turns_per_m_[0][k] * point_m.x() + turns_per_m_[1][k] * point_m.y() +
                        turns_per_m_[2][k] * point_m.z() + phase_turns_[k];
    // cos(2 pi r) = -sin(2 pi s) with s = |r| - 1/4 in [-1/4, 1/4], r the turns without their whole part:
    // there the Taylor series to the 17th power is exact to 5e-14, and the bits do not depend on the C
    // library.
    const Lanes x = ((turns - (turns + 0.5).floor()).abs() - 0.25) * (2 * kPi);
    const Lanes z = x * x;
    Lanes series = 1.0 - z * (1.0 / 272);
    series = 1.0 - z * (1.0 / 210) * series;
    series = 1.0 - z * (1.0 / 156) * series;
    series = 1.0 - z * (1.0 / 110) * series;
    series = 1.0 - z * (1.0 / 72) * series;
    series = 1.0 - z * (1.0 / 42) * series;
    series = 1.0 - z * (1.0 / 20) * series;
    series = 1.0 - z * (1.0 / 6) * series;
    sum -= x * series;
  }
  double total = 0;
  for (int lane = 0; lane < Lanes::RowsAtCompileTime; ++lane) total += sum[lane];
  return scale_ * total;
}

}  // namespace touchstone::effects
