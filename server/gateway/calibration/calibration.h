// Where things stand on the rig: the tool on the flange, the objects on the fixture, the camera. A file that
// people edit and `touchstone rig calibrate` writes.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Geometry>

#include "server/geometry/mesh.h"

namespace touchstone {

// File (YAML):
//   touchstone: calibration/1
//   flange_from_tip:    {translation_mm: [0, 0, 120], rotation_deg: [0, 0, 0]}     # rotation vectors
//   flange_from_camera: {translation_mm: [0, 60, 40], rotation_deg: [0, 0, 0]}     # optional; z looks ahead,
//   y down base_from_object:                                                              # placement +z
//     lat20: {translation_mm: [300, 0, 100], rotation_deg: [0, 0, 0]}
//   made: {date: 2026-01-31, how: "...", rms_mm: {lat20: 0.02}}                    # optional, for people
// Tip frame: origin at the middle finger's tip, z along the approach, x from the first finger to the last.
struct Calibration {
  Eigen::Isometry3d flange_from_tip = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d flange_from_camera = Eigen::Isometry3d::Identity();
  bool has_camera = false;
  std::map<std::string, Eigen::Isometry3d> base_from_object;
  std::map<std::string, std::string> notes;  // "date", "how", "rms_mm lat20"
};

// Errors name the file, the place and what would be right; unknown keys are refused.
absl::StatusOr<Calibration> ParseCalibration(const std::string& text, const std::string& origin);
absl::StatusOr<Calibration> ReadCalibration(const std::string& path);
std::string FormatCalibration(const Calibration& calibration);

// The faces of an object's box, each of which can be turned up on the fixture.
const std::vector<std::string>& Placements();  // "+x", "-x", "+y", "-y", "+z", "-z"

// base_from_object when the face `placement` points up: the object is turned about the centre of its box by
// the rotation of least angle (180 deg about x for "-z") and lowered or raised so that it rests as high as at
// "+z".
Eigen::Isometry3d BaseFromObject(const Eigen::Isometry3d& base_from_object_at_plus_z, const Bounds& bounds,
                                 const std::string& placement);

// The placement in which a touch along `approach` (object frame) comes most from above; of equal ones the
// first.
std::string PlacementFor(const Eigen::Vector3d& approach);

}  // namespace touchstone
