// Images, cameras and what a renderer is asked for.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace touchstone::image {

// A pinhole camera in the object frame, metres. The image's first row is the top.
struct Camera {
  Eigen::Vector3d eye_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d at_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // need not be perpendicular to the view, nor of unit length
  double vertical_fov_rad = 0.78539816339744831;  // 45 deg
  double near_m = 0;                              // depths of the planes; where 0, chosen so that
  double far_m = 0;                               // the object is enclosed
};

// The camera of a touch: eye = the middle finger's start (target - approach * standoff), at = target,
// up = lateral x approach. Object frame; approach and lateral are unit vectors.
Camera CameraOfTouch(const Eigen::Vector3d& target_m, const Eigen::Vector3d& approach,
                     const Eigen::Vector3d& lateral, double standoff_m);

enum class PixelFormat { kGrey, kRgb };
enum class ShadingStyle {
  kShaded,       // white point lights, no shadows, black background
  kDarkOnWhite,  // the shading inverted and compressed: a dark object on white (see shading.h)
};

struct ImageOptions {
  int width = 224;  // 1 to kMaxImageSide
  int height = 224;
  PixelFormat format = PixelFormat::kGrey;
  ShadingStyle shading_style = ShadingStyle::kShaded;
  bool depth = false;  // also return depth
  bool mask = false;   // also return the object mask
};
inline constexpr int kMaxImageSide = 2048;

struct Image {
  int width = 0;
  int height = 0;
  int channels = 0;             // 1 or 3
  std::vector<uint8_t> pixels;  // height x width x channels, rows from the top
  std::vector<float>
      depth_m;                // height x width, along the viewing axis; 0 where no object; empty if not asked
  std::vector<uint8_t> mask;  // height x width, 255 object, 0 background; empty if not asked
};

}  // namespace touchstone::image
