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

  bool ChangesLens() const { return focal_relative != 0 || !principal_px.isZero() || k1 != 0 || k2 != 0; }
  bool ChangesLight() const { return vignetting != 0 || defocus_px != 0 || stops != 0 || gamma != 1; }
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
  std::vector<char> shows_object;  // pixels that do not show the ground; none: that makes no difference
};

// A pinhole picture of this vertical field of view (rad), its axis through the middle.
using Pinhole = std::function<Light(int width, int height, double vertical_fov_rad)>;
// Which rays meet the object; a ray by where it passes one step before the eye: right, down.
using MeetsObject = std::function<std::vector<char>(const std::vector<Eigen::Vector2d>& rays)>;

// What falls on the sensor through the real lens of a camera that is nominally a pinhole of this size and field of view:
// its pixels' centres are looked up in a finer and wider pinhole picture, and the outline is where the rays themselves
// leave the object, so that it stays as sharp as the pinhole's. The nominal picture if the lens is ideal.
Light ThroughLens(const HiddenCamera& hidden, int width, int height, double vertical_fov_rad,
                  const Pinhole& pinhole, const MeetsObject& meets_object);

// Vignetting, defocus, exposure with its clipping at white, response. In place.
void Develop(const HiddenCamera& hidden, Light* light);

// Grey levels with the hidden noise, which must be set.
std::vector<uint8_t> Record(const HiddenCamera& hidden, const Light& light, std::mt19937_64* random);

}  // namespace touchstone::rig
