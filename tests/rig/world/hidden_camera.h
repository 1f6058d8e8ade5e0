// What is hidden in the emulated camera: its lens, its exposure, its noise, and how it really sits on the flange. Written
// from the definitions of the catalogue (DESIGN, section 5; what touchstone effects prints) and OpenCV's published camera
// model; it shares nothing with the effects that a diagnosis fits. Test tool: nothing that it makes is called real.
#pragma once

#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Geometry>

namespace touchstone::rig {

// Every number starts where it changes nothing.
struct HiddenCamera {
  Eigen::Vector3d offset_mm = Eigen::Vector3d::Zero();     // of the mounting, camera frame (x right, y down)
  Eigen::Vector3d rotation_deg = Eigen::Vector3d::Zero();  // likewise, rotation vector
  double focal_relative = 0;
  Eigen::Vector2d principal_px = Eigen::Vector2d::Zero();
  double k1 = 0, k2 = 0;
  double vignetting = 0, defocus_px = 0, stops = 0, gamma = 1;
  // None: the camera's own dark ground and its even noise (camera.h).
  std::optional<double> ground_grey, sigma_grey;
  double noise_gain = 0;
};

// "radial_distortion.k1=-0.2", "camera_rotation.rotation_deg=0,0,0.5": names and units of the catalogue's image effects,
// as far as they are emulated. False: `assignment` is of no effect of photographs. Throws std::invalid_argument that names
// what is wrong and what would be right.
bool HideInCamera(const std::string& assignment, HiddenCamera* camera);

// "camera_rotation.rotation_deg, ...": what can be hidden.
std::string HiddenCameraNames();

// Where the camera really is.
Eigen::Affine3d RealPose(const HiddenCamera& hidden, const Eigen::Affine3d& from_camera);

// A picture in linear light, white at 1, rows from the top; pixel centres at half-integers.
struct Light {
  int width = 0, height = 0;
  std::vector<double> level;
};

// The light of rays, each by where it passes one step before the eye: right, down.
using LightAlong = std::function<std::vector<double>(const std::vector<Eigen::Vector2d>& rays)>;

// What falls on the pixels' centres through the real lens of a camera that is nominally a pinhole of this size and
// vertical field of view (rad), its axis through the middle.
Light ThroughLens(const HiddenCamera& hidden, int width, int height, double vertical_fov_rad,
                  const LightAlong& light_along);

// Vignetting, defocus, exposure with its clipping at white, response. In place.
void Develop(const HiddenCamera& hidden, Light* light);

// Grey levels with the hidden noise, which must be set.
std::vector<uint8_t> Record(const HiddenCamera& hidden, const Light& light, std::mt19937_64* random);

}  // namespace touchstone::rig
