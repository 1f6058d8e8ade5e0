// An image set in memory: photographs of objects from commanded camera poses. Files: DESIGN section 7, in words in
// measurement_files.md; SI units, object frame.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace touchstone::session {

// From where a camera looks, metres. `up` is as commanded, neither unit nor perpendicular.
struct CameraPlacement {
  Eigen::Vector3d eye_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d at_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

// The nominal lens of all pictures of a set. Pixel centres lie at half-integers. Distortion as OpenCV's.
struct CameraIntrinsics {
  int width_px = 0, height_px = 0;
  double fx_px = 0, fy_px = 0, cx_px = 0, cy_px = 0;
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;
};

struct PhotographRow {
  uint64_t image = 0;  // its number in the file
  std::string file;    // relative to the folder
  int object = 0;      // index into ImageSet::objects
  CameraPlacement commanded;
  std::optional<CameraPlacement> measured;
  double session_time_s = 0;
  int round = -1;                            // -1: unknown
  std::optional<uint64_t> touch;             // the touch of touches.csv that it was taken with
  std::map<std::string, double> covariates;  // "cov_NAME"
  int line = 0;                              // of images.csv
  int channels = 1;                          // 1 grey, 3 RGB
  std::vector<uint8_t> pixels;               // height x width x channels, rows from the top
};

struct ImageSet {
  std::string origin;  // the folder, for messages
  CameraIntrinsics camera;
  std::vector<std::string> objects;  // in order of appearance
  std::vector<PhotographRow> photographs;
  bool has_session_time = false, has_round = false, has_measured = false;
  std::string sha256;  // of images.csv, camera.yaml and every picture, in the order of the rows

  size_t size() const { return photographs.size(); }
  // Grey levels, height x width: of RGB the mean of the three, which our grey pictures of a white object equal.
  std::vector<float> Grey(size_t photograph) const;
};

}  // namespace touchstone::session
