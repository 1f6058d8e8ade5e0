// How an object rests on the fixture: which face of its box points up.
#pragma once

#include <array>
#include <string>

#include <absl/status/statusor.h>
#include <Eigen/Geometry>

#include "server/geometry/mesh/mesh.h"

namespace touchstone::gateway::calibration {

// A face of the box around an object, object frame; the numbers are those of v1::UpFace.
enum class UpFace : int { kPlusX = 1, kMinusX = 2, kPlusY = 3, kMinusY = 4, kPlusZ = 5, kMinusZ = 6 };

inline constexpr std::array<UpFace, 6> kUpFaces = {UpFace::kPlusX,  UpFace::kMinusX, UpFace::kPlusY,
                                                   UpFace::kMinusY, UpFace::kPlusZ,  UpFace::kMinusZ};

// "+x", "-x", "+y", "-y", "+z", "-z": as files, journals and the command line write it.
const char* UpFaceName(UpFace face);
// INVALID_ARGUMENT begins with `where` and lists the names.
absl::StatusOr<UpFace> ParseUpFace(const std::string& name, const std::string& where);

// base_from_object when `face` points up: the object is turned about the centre of its box by the rotation of
// least angle (180 deg about x for -z) and lowered or raised so that it rests as high as at +z.
Eigen::Isometry3d BaseFromObject(const Eigen::Isometry3d& base_from_object_at_plus_z,
                                 const geometry::Bounds& bounds, UpFace face);

// The face that must point up for a touch along `approach` (object frame) to come most from above; of equal
// ones the first of kUpFaces.
UpFace UpFaceFor(const Eigen::Vector3d& approach);

}  // namespace touchstone::gateway::calibration
