// A smooth random field over space: what is left of a surface when its mesh is subtracted from a bad print.
//
// Random Fourier features of a Matern-5/2 covariance (Rahimi & Recht, "Random features for large-scale kernel
// machines", 2007): h(x) = scale * sum_k cos(w_k . x + phase_k), w_k = z_k sqrt(5 / chi^2_5) / length with
// z_k normal in three dimensions. Two points a length apart correlate by 0.52, two lengths by 0.14.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <absl/types/span.h>
#include <Eigen/Core>

namespace touchstone::effects {

class SmoothField {
 public:
  static constexpr int kFeatures = 256;

  // A pure function of its arguments. The field has RMS 1 over `points_m` (the object's surface), exactly: on
  // an object of a few lengths the RMS of a free field would be off by tens of per cent from one draw to the
  // next. Without points it has RMS 1 over all fields.
  SmoothField(uint64_t seed, uint64_t object_id, double length_m, absl::Span<const Eigen::Vector3d> points_m);

  double At(const Eigen::Vector3d& point_m) const;

 private:
  using Lanes = Eigen::Array<double, 8, 1>;  // summed lane by lane, so that the order of additions is fixed

  std::vector<Lanes> turns_per_m_[3];  // w_k / 2 pi
  std::vector<Lanes> phase_turns_;
  double scale_ = 1;
};

}  // namespace touchstone::effects
