// Where things stand on the rig: the tool on the flange, the objects on the fixture, the camera. A file that
// people edit and `touchstone rig calibrate` writes.
#pragma once

#include <map>
#include <string>

#include <absl/status/statusor.h>
#include <Eigen/Geometry>

namespace touchstone::gateway::calibration {

// File (YAML). Rotations are rotation vectors; the keys that are marked optional may be missing.
//   touchstone: calibration/1
//   flange_from_tip: {translation_mm: [0, 0, 120], rotation_deg: [0, 0, 0]}
//   flange_from_camera: {translation_mm: [0, 60, 40], rotation_deg: [0, 0, 0]}   # optional; z ahead, y down
//   base_from_object:                                                            # resting on -z: face +z up
//     lat20: {translation_mm: [300, 0, 100], rotation_deg: [0, 0, 0]}
//   made: {date: 2026-01-31, how: "...", rms_mm: {lat20: 0.02}}                  # optional, for people
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

}  // namespace touchstone::gateway::calibration
