// The lens of a photograph, and where each pixel of it looks. OpenCV's model: with x = X / Z, y = Y / Z, r^2 = x^2 + y^2,
//   x_d = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
//   y_d = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y
//   column = fx x_d + cx,  row = fy y_d + cy,  pixel centres at half-integers.
#pragma once

#include <array>
#include <vector>

#include <absl/status/status.h>
#include <Eigen/Core>

#include "server/effects/photo_settings.h"
#include "server/image/photograph/photograph.h"

namespace touchstone::image {

struct PhotoLens {
  int width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;

  bool Distorts() const { return k1 != 0 || k2 != 0 || p1 != 0 || p2 != 0 || k3 != 0; }
  // From normalised coordinates (right, down) to distorted ones.
  Eigen::Vector2d Distort(const Eigen::Vector2d& ideal) const;
  // Where a point of the camera frame (z > 0) lies in the picture, px.
  Eigen::Vector2d Project(const Eigen::Vector3d& point_in_camera) const;
  // By the point.
  Eigen::Matrix<double, 2, 3> ProjectDerivative(const Eigen::Vector3d& point_in_camera) const;
  // Square of the radius up to which the radial part grows: beyond it the lens model folds the picture over, and no
  // pixel looks there. Infinite if it always grows.
  double FoldRadiusSquared() const;
  std::array<double, 9> Numbers() const { return {fx, fy, cx, cy, k1, k2, p1, p2, k3}; }
};

// Errors name the field: sizes, focal lengths that are not positive, numbers that are not finite, another number of
// distortion coefficients than 0, 4 or 5.
absl::Status CheckLens(const Intrinsics& lens);
PhotoLens EffectiveLens(const Intrinsics& nominal, const effects::PhotoSettings& settings);

// The viewing ray through each pixel's centre: right and up for one step forward. NaN where the lens model sees nothing.
struct PixelSlopes {
  std::vector<float> right, up;  // height x width
};
// `*any`: whether any pixel sees something.
void FillSlopes(const PhotoLens& lens, PixelSlopes* slopes, bool* any);

}  // namespace touchstone::image
