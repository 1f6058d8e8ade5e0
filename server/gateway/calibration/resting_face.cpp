// How an object lies on the fixture: which face of its box points up.
#include <absl/strings/str_cat.h>

#include "server/base/check.h"
#include "server/gateway/calibration/calibration.h"

namespace touchstone {
namespace {

using Eigen::Vector3d;

// Approaches are exact to rounding only: what differs by less comes equally from above.
constexpr double kEqualCosine = 1e-9;

struct Face {
  int axis = 2;
  double sign = 1;
  Vector3d Normal() const { return sign * Vector3d::Unit(axis); }
};

// A name that is none of Placements() is a bug of the caller: names from outside are checked where they come
// in.
Face FaceOf(const std::string& placement) {
  TOUCHSTONE_CHECK(placement.size() == 2 && (placement[0] == '+' || placement[0] == '-'));
  TOUCHSTONE_CHECK(placement[1] >= 'x' && placement[1] <= 'z');
  return {placement[1] - 'x', placement[0] == '+' ? 1.0 : -1.0};
}

// The rotation of least angle that turns the face's normal to +z; entries are exactly 0 and +-1.
Eigen::Matrix3d TurnUp(const Face& face) {
  const Vector3d normal = face.Normal();
  const Vector3d up = Vector3d::UnitZ();
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  if (face.axis == 2) {
    if (face.sign < 0) turn.diagonal() << 1, -1, -1;
    return turn;
  }
  // A quarter turn about normal x up: normal -> up, up -> -normal, the axis stays.
  const Vector3d axis = normal.cross(up);
  return axis * axis.transpose() + up * normal.transpose() - normal * up.transpose();
}

}  // namespace

const std::vector<std::string>& Placements() {
  static const std::vector<std::string> placements = {"+x", "-x", "+y", "-y", "+z", "-z"};
  return placements;
}

Eigen::Isometry3d BaseFromObject(const Eigen::Isometry3d& base_from_object_at_plus_z, const Bounds& bounds,
                                 const std::string& placement) {
  const Face face = FaceOf(placement);
  const Vector3d centre_m = bounds.Centre();
  const Vector3d half_m = 0.5 * (bounds.max_m - bounds.min_m);
  Eigen::Isometry3d turned = Eigen::Isometry3d::Identity();
  turned.linear() = TurnUp(face);
  // The box stands on the height on which it stood at +z, and is now as high as it was thick along that axis.
  const Vector3d new_centre_m = centre_m + Vector3d(0, 0, half_m[face.axis] - half_m.z());
  turned.translation() = new_centre_m - turned.linear() * centre_m;
  return base_from_object_at_plus_z * turned;
}

std::string PlacementFor(const Vector3d& approach) {
  std::string best;
  double best_cosine = 0;
  for (const std::string& placement : Placements()) {
    const double cosine = approach.dot(FaceOf(placement).Normal());
    if (best.empty() || cosine < best_cosine - kEqualCosine) {
      best = placement;
      best_cosine = cosine;
    }
  }
  return best;
}

}  // namespace touchstone
