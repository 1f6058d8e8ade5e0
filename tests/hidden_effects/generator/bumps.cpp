#include "tests/hidden_effects/generator/bumps.h"

#include <cmath>

namespace touchstone::hidden {

constexpr int kWaves = 128;
constexpr size_t kPoints = 2000;

Bumps::Bumps(const Solid& solid, double rms_mm, double length_mm, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> phase(0, 2 * M_PI);
  for (int k = 0; k < kWaves; ++k) {
    const double x = normal(random), y = normal(random), z = normal(random);
    waves_.push_back({Eigen::Vector3d(x, y, z) / length_mm, phase(random), 1});
  }
  const auto& vertices = solid.triangles().vertices_mm;
  double squares = 0;
  size_t points = 0;
  const size_t step = 1 + vertices.size() / kPoints;
  for (size_t k = 0; k < vertices.size(); k += step, ++points) {
    const double height = HeightMm(vertices[k]);
    squares += height * height;
  }
  const double factor = squares > 0 ? rms_mm / std::sqrt(squares / points) : 0;
  for (Wave& wave : waves_) wave.height_mm = factor;
}

double Bumps::HeightMm(const Eigen::Vector3d& point_mm) const {
  double height = 0;
  for (const Wave& wave : waves_) height += wave.height_mm * std::cos(wave.per_mm.dot(point_mm) + wave.phase);
  return height;
}

}  // namespace touchstone::hidden
