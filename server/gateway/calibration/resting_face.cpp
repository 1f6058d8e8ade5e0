#include "server/gateway/calibration/resting_face.h"

#include <absl/strings/str_cat.h>

namespace touchstone::gateway::calibration {
namespace {

using Eigen::Vector3d;

// Approaches are exact to rounding only: what differs by less comes equally from above.
constexpr double kEqualCosine = 1e-9;

int AxisOf(UpFace face) {
  return (static_cast<int>(face) - 1) / 2;
}

double SignOf(UpFace face) {
  return static_cast<int>(face) % 2 == 1 ? 1 : -1;
}

Vector3d NormalOf(UpFace face) {
  return SignOf(face) * Vector3d::Unit(AxisOf(face));
}

// The rotation of least angle that turns the face's normal to +z; entries are exactly 0 and +-1.
Eigen::Matrix3d TurnUp(UpFace face) {
  const Vector3d normal = NormalOf(face);
  const Vector3d up = Vector3d::UnitZ();
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  if (AxisOf(face) == 2) {
    if (SignOf(face) < 0) turn.diagonal() << 1, -1, -1;
    return turn;
  }
  // A quarter turn about normal x up: normal -> up, up -> -normal, the axis stays.
  const Vector3d axis = normal.cross(up);
  return axis * axis.transpose() + up * normal.transpose() - normal * up.transpose();
}

}  // namespace

const char* UpFaceName(UpFace face) {
  static constexpr const char* kNames[] = {"+x", "-x", "+y", "-y", "+z", "-z"};
  return kNames[static_cast<int>(face) - 1];
}

absl::StatusOr<UpFace> ParseUpFace(const std::string& name, const std::string& where) {
  for (const UpFace face : kUpFaces)
    if (name == UpFaceName(face)) return face;
  return absl::InvalidArgumentError(
      absl::StrCat(where, " = '", name, "': the face that points up, one of +x, -x, +y, -y, +z, -z"));
}

Eigen::Isometry3d BaseFromObject(const Eigen::Isometry3d& base_from_object_at_plus_z,
                                 const geometry::Bounds& bounds, UpFace face) {
  const Vector3d centre_m = bounds.Centre();
  const Vector3d half_m = 0.5 * (bounds.max_m - bounds.min_m);
  Eigen::Isometry3d turned = Eigen::Isometry3d::Identity();
  turned.linear() = TurnUp(face);
  // The box stands on the height on which it stood at +z, and is now as high as it was thick along that axis.
  const Vector3d new_centre_m = centre_m + Vector3d(0, 0, half_m[AxisOf(face)] - half_m.z());
  turned.translation() = new_centre_m - turned.linear() * centre_m;
  return base_from_object_at_plus_z * turned;
}

UpFace UpFaceFor(const Vector3d& approach) {
  UpFace best = kUpFaces.front();
  double best_cosine = approach.dot(NormalOf(best));
  for (const UpFace face : kUpFaces) {
    const double cosine = approach.dot(NormalOf(face));
    if (cosine < best_cosine - kEqualCosine) {
      best = face;
      best_cosine = cosine;
    }
  }
  return best;
}

}  // namespace touchstone::gateway::calibration
