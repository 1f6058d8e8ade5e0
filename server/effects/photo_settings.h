// What effects change of one photograph: the camera, the light and the image sensor, as numbers that the simulation of
// photographs reads (image/photograph/simulate_photo.h). The stages camera pose, projection, shading and image sensor run in the
// order of the fields; every field starts at the value that changes nothing.
//
// Camera frame as OpenCV's: x right, y down, z forward. Linear light: what the nominal shading gives, 0 to 1, white at
// 1; the nominal camera records it as it is (grey = 255 * light). Pixel centres lie at half-integers.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace touchstone::effects {

// What a formula or a lookup may read of one pixel, in the units of files.
struct PhotoPixel {
  double radius = 0;         // distance from the principal point over half the diagonal: 0 to 1
  double column = 0;         // of the pixel's centre, px from the left edge
  double row = 0;            // px from the upper edge
  double grey = 0;           // recorded so far, 0 to 255
  double incidence_deg = 0;  // between the viewing ray and the inward surface normal; 90 on the background
  double depth_mm = 0;       // along the viewing axis; 0 on the background
  double session_time_s = 0;
};

struct PhotoSettings {
  // --- Camera pose: the real camera = the commanded one, moved in its own frame, then turned about its centre ---
  Eigen::Vector3d camera_offset_m = Eigen::Vector3d::Zero();
  Eigen::Matrix3d camera_rotation = Eigen::Matrix3d::Identity();  // commanded_camera_from_real_camera

  // --- Projection: u = fx (1 + ...) x (1 + k1 r^2 + k2 r^4) + cx + ..., as OpenCV's ---
  double focal_factor = 1;  // of fx and fy
  Eigen::Vector2d principal_point_offset_px = Eigen::Vector2d::Zero();
  double k1 = 0, k2 = 0;  // added to those of the nominal lens

  // --- Shading, in linear light ---
  Eigen::Vector3d key_light_offset_m =
      Eigen::Vector3d::Zero();                          // in the image's axes: right, up, towards the eye
  double ambient = 0;                                   // added to the ambient term
  double specular_strength = 0, specular_exponent = 1;  // Blinn-Phong highlight of the key light
  double shadow_strength = 0;   // share of the key light that points in its shadow lose
  double background_light = 0;  // of the ground behind the object

  // --- Image sensor, in this order ---
  double vignetting = 0;                              // light times (1 - this * radius^2)
  double defocus_sigma_px = 0;                        // Gaussian
  double motion_length_px = 0, motion_angle_rad = 0;  // box along a direction; 0: right, pi / 2: up
  double exposure_factor = 1;                         // of the light, which is then clipped at white
  double gamma = 1;                                   // recorded = light ^ gamma
  double srgb_share = 0;        // 1: then sRGB's curve of it; between 0 and 1, in fits alone, a mean of both
  double black_level_grey = 0;  // added to what is recorded, up to white
  // Formulas and lookups: each adds grey levels to a recorded pixel; the result is clipped to 0 to 255.
  std::vector<std::function<double(const PhotoPixel&)>> added_grey;
  double noise_sigma_grey = 0, noise_gain = 0;  // variance sigma^2 + gain * grey, before rounding to 8 bits

  std::string formula_error;  // as in TouchBatch
};

}  // namespace touchstone::effects
