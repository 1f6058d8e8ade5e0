#include "server/base/touch_limits.h"

#include <cmath>

namespace touchstone {
namespace {

constexpr double kRounding = 4e-16;

bool MakeUnit(Eigen::Vector3d* vector) {
  const double length = vector->norm();
  if (!(std::abs(length - 1) <= kVectorTolerance)) return false;
  if (std::abs(length - 1) > kRounding) *vector /= length;
  return true;
}

}  // namespace

VectorFlaw MakeOrthonormal(Eigen::Vector3d* approach, Eigen::Vector3d* lateral) {
  Eigen::Vector3d unit_approach = *approach, unit_lateral = *lateral;
  if (!MakeUnit(&unit_approach)) return VectorFlaw::kApproachLength;
  if (!MakeUnit(&unit_lateral)) return VectorFlaw::kLateralLength;
  const double cosine = unit_approach.dot(unit_lateral);
  if (!(std::abs(cosine) <= kVectorTolerance)) return VectorFlaw::kNotPerpendicular;
  if (std::abs(cosine) > kRounding) unit_lateral = (unit_lateral - cosine * unit_approach).normalized();
  *approach = unit_approach, *lateral = unit_lateral;
  return VectorFlaw::kNone;
}

}  // namespace touchstone
