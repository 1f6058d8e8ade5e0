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
  if (!MakeUnit(approach)) return VectorFlaw::kApproachLength;
  if (!MakeUnit(lateral)) return VectorFlaw::kLateralLength;
  const double cosine = approach->dot(*lateral);
  if (!(std::abs(cosine) <= kVectorTolerance)) return VectorFlaw::kNotPerpendicular;
  if (std::abs(cosine) > kRounding) *lateral = (*lateral - cosine * *approach).normalized();
  return VectorFlaw::kNone;
}

}  // namespace touchstone
