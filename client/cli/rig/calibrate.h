// What the kinds of `touchstone rig calibrate` share.
#pragma once

#include <string>

#include <Eigen/Geometry>

#include "client/cli/rig/rig.h"

namespace touchstone::cli {

struct CalibrateOptions {
  MotionFlags motion;
  std::string kind = "flat", object, output, from, calibration, surface;
  int touches = 20, poses = 6;
  double speed_mm_s = 20;
  double spacing_mm = 0;  // 0: that of the rig or of the recorded session
};

// "2026-01-31", UTC.
std::string Today();
Eigen::Isometry3d PoseOf(const v1::BasePose& pose);
// "1, 2.5, -3": metres as millimetres.
std::string InMillimetres(const Eigen::Vector3d& metres);

// The object of that name; the error offers the nearest.
absl::StatusOr<v1::Object> FindObject(client::Connection* connection, const std::string& name);

absl::Status RunCalibrateObject(const Cli& cli, const CalibrateOptions& options);

}  // namespace touchstone::cli
