// Smooth bumps of a badly printed surface: a random Gaussian field in space, read on the surface.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include <Eigen/Core>

#include "tests/hidden_effects/generator/solid.h"

namespace touchstone::hidden {

class Bumps {
 public:
  Bumps() = default;  // none
  // Squared-exponential correlation of this length, scaled to exactly this RMS over the vertices of the
  // solid.
  Bumps(const Solid& solid, double rms_mm, double length_mm, std::mt19937_64& random);

  // How far the surface stands out at a point, mm.
  double HeightMm(const Eigen::Vector3d& point_mm) const;

 private:
  struct Wave {
    Eigen::Vector3d per_mm;
    double phase, height_mm;
  };
  std::vector<Wave> waves_;
};

}  // namespace touchstone::hidden
