#include "server/image/scene/view.h"

#include <algorithm>
#include <cmath>

namespace touchstone::image {
namespace {

Eigen::Vector3d CornerOf(const geometry::Bounds& bounds, int corner) {
  return {(corner & 1) ? bounds.max_m.x() : bounds.min_m.x(),
          (corner & 2) ? bounds.max_m.y() : bounds.min_m.y(),
          (corner & 4) ? bounds.max_m.z() : bounds.min_m.z()};
}

double SmallestDepthM(const View& view, const geometry::Bounds& bounds) {
  double smallest = view.DepthM(CornerOf(bounds, 0));
  for (int corner = 1; corner < 8; ++corner)
    smallest = std::min(smallest, view.DepthM(CornerOf(bounds, corner)));
  return smallest;
}

}  // namespace

Eigen::Vector2d View::Project(const Eigen::Vector3d& point_m) const {
  const Eigen::Vector3d from_eye = point_m - eye_m;
  const double scale = 1.0 / (from_eye.dot(forward) * step);
  return {0.5 * width + from_eye.dot(right) * scale, 0.5 * height - from_eye.dot(up) * scale};
}

Eigen::Vector3d View::PixelVector(int column, int row) const {
  return forward + (column + 0.5 - 0.5 * width) * step * right + (0.5 * height - row - 0.5) * step * up;
}

View MakeView(const Camera& camera, const geometry::Bounds& bounds, const ImageOptions& options) {
  View view;
  view.width = options.width;
  view.height = options.height;
  view.eye_m = camera.eye_m;
  view.forward = (camera.at_m - camera.eye_m).normalized();
  view.right = view.forward.cross(camera.up.normalized()).normalized();
  view.up = view.right.cross(view.forward);
  view.step = 2.0 * std::tan(0.5 * camera.vertical_fov_rad) / options.height;

  // A little more than the bounding sphere, so that rounding cuts nothing off.
  const double radius_m = 0.5 * bounds.DiagonalM() * 1.001 + 1e-9;
  const double centre_m = view.DepthM(bounds.Centre());
  view.far_m = camera.far_m > 0 ? camera.far_m : std::max(centre_m + radius_m, 2.0 * camera.near_m);
  if (!(view.far_m > 0)) view.far_m = radius_m;  // the object is behind the eye: any planes do
  view.near_m = camera.near_m > 0 ? camera.near_m : centre_m - radius_m;
  // From inside the sphere: near enough to cut nothing that a person would miss, far enough for the depth
  // buffer.
  view.near_m = std::max(view.near_m, camera.near_m > 0 ? 0.0 : 1e-4 * std::min(view.far_m, radius_m));
  if (!(view.near_m < view.far_m)) view.near_m = 0.5 * view.far_m;
  return view;
}

void FillAround(const PixelBox& box, float value, int width, std::vector<float>* picture) {
  if (box.first_row >= box.last_row || box.first_column >= box.last_column) {
    std::fill(picture->begin(), picture->end(), value);
    return;
  }
  const auto begin_of = [&](int row) { return picture->begin() + static_cast<long>(row) * width; };
  std::fill(picture->begin(), begin_of(box.first_row), value);
  for (int row = box.first_row; row < box.last_row; ++row) {
    std::fill_n(begin_of(row), box.first_column, value);
    std::fill(begin_of(row) + box.last_column, begin_of(row + 1), value);
  }
  std::fill(begin_of(box.last_row), picture->end(), value);
}

PixelBox ProjectBounds(const View& view, const geometry::Bounds& bounds) {
  if (SmallestDepthM(view, bounds) < 0.5 * view.near_m) return {0, 0, view.width, view.height};
  Eigen::Vector2d min_pixel = view.Project(CornerOf(bounds, 0));
  Eigen::Vector2d max_pixel = min_pixel;
  for (int corner = 1; corner < 8; ++corner) {
    const Eigen::Vector2d pixel = view.Project(CornerOf(bounds, corner));
    min_pixel = min_pixel.cwiseMin(pixel);
    max_pixel = max_pixel.cwiseMax(pixel);
  }
  // One pixel more on each side: the projection above is rounded, a whole column must not depend on that.
  const auto clip = [](double value, int size) {
    return static_cast<int>(std::min<double>(size, std::max<double>(0.0, value)));
  };
  return {clip(std::floor(min_pixel.x()) - 1, view.width), clip(std::floor(min_pixel.y()) - 1, view.height),
          clip(std::ceil(max_pixel.x()) + 1, view.width), clip(std::ceil(max_pixel.y()) + 1, view.height)};
}

bool SeesOnlyOutside(const View& view, const geometry::Bounds& bounds) {
  const bool eye_in_box = (view.eye_m.array() >= bounds.min_m.array()).all() &&
                          (view.eye_m.array() <= bounds.max_m.array()).all();
  return !eye_in_box && SmallestDepthM(view, bounds) >= view.near_m;
}

}  // namespace touchstone::image
