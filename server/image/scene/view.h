// A camera made ready for one image: axes, planes and the size of a pixel. Both renderers start from it, so a
// point lands on the same pixel in either.
//
// Pixel (column x, row y), rows from the top, looks along
//   forward + (x + 0.5 - width/2) * step * right + (height/2 - y - 0.5) * step * up,
// a vector whose part along `forward` is 1: its multiple is the depth.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "server/geometry/mesh/mesh.h"
#include "server/image/image.h"

namespace touchstone::image {

struct View {
  int width = 0;
  int height = 0;
  Eigen::Vector3d eye_m;
  Eigen::Vector3d right;  // unit vectors, right x up = -forward
  Eigen::Vector3d up;
  Eigen::Vector3d forward;  // from the eye into the scene
  double step = 0;    // tangent of the angle of one pixel at the image's centre: 2 tan(fov / 2) / height
  double near_m = 0;  // depths, 0 < near_m < far_m
  double far_m = 0;

  // Depth of a point along the viewing axis.
  double DepthM(const Eigen::Vector3d& point_m) const { return (point_m - eye_m).dot(forward); }
  // Where a point of positive depth lies, in pixels from the image's upper left corner (x to the right, y
  // down).
  Eigen::Vector2d Project(const Eigen::Vector3d& point_m) const;
  // The viewing vector of a pixel's centre; its part along `forward` is 1.
  Eigen::Vector3d PixelVector(int column, int row) const;
};

// Where a plane of the camera is 0, it is chosen so that the sphere around `bounds` is enclosed. The near
// plane is never behind the eye. The request must be valid (ValidateImageRequest).
View MakeView(const Camera& camera, const geometry::Bounds& bounds, const ImageOptions& options);

// A whole number of pixels that holds the projection of `bounds`, clipped to the image: first column and row,
// and one past the last. Empty (first >= last) if the box is beside the image; the whole image if it reaches
// behind the near plane.
struct PixelBox {
  int first_column = 0;
  int first_row = 0;
  int last_column = 0;
  int last_row = 0;
};
// Sets the pixels of a picture, row by row, that lie outside the box; all of them where it is empty.
void FillAround(const PixelBox& box, float value, int width, std::vector<float>* picture);
PixelBox ProjectBounds(const View& view, const geometry::Bounds& bounds);

// True if no part of the box is cut off by the near plane and the eye is outside it: of a closed surface only
// outer faces can then be seen.
bool SeesOnlyOutside(const View& view, const geometry::Bounds& bounds);

}  // namespace touchstone::image
