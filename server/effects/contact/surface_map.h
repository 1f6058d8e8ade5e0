// The known departure of an object's surface from its mesh, between its points of support (model/surface_map.md).
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "server/model/effect.h"

namespace touchstone::effects {

// Of one object; frame of the mesh file, SI. Any number of threads may ask at once.
class SurfaceDeparture {
 public:
  explicit SurfaceDeparture(const model::SurfaceMapObject& object);

  double At(const Eigen::Vector3d& point_m) const;        // m, along the outward normal
  double StdDevAt(const Eigen::Vector3d& point_m) const;  // m
  // Covariance of the departures at several places, m^2: what lies between the points of support exactly,
  // what is open about these as alike as departures are (the map does not keep their correlations).
  Eigen::MatrixXd CovarianceAt(const std::vector<Eigen::Vector3d>& points_m) const;
  // The largest correlation with any point of support, 0 to 1: near 0 nothing is known.
  double NearnessAt(const Eigen::Vector3d& point_m) const;
  double length_m() const { return length_m_; }
  double rms_m() const { return rms_m_; }

 private:
  Eigen::VectorXd KernelAt(const Eigen::Vector3d& point_m) const;

  double length_m_, rms_m_;
  std::vector<Eigen::Vector3d> points_m_;
  Eigen::VectorXd weights_, variances_m2_;
  Eigen::LLT<Eigen::MatrixXd> kernel_;
};

// Checks a map and makes it act. The effect may be applied by any number of threads at once; its name is
// "surface_map", its definition is effect->surface_map. It has no parameters: a map is changed as a whole.
absl::StatusOr<std::shared_ptr<const model::Effect>> MakeSurfaceMapEffect(const model::SurfaceMapSpec& spec);

}  // namespace touchstone::effects
