#include "server/image/renderers/cpu_frame.h"

#include <algorithm>

namespace touchstone::image {
namespace {

Vec3f ToFloat(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

}  // namespace

void SetRays(CpuFrame* frame) {
  const View& view = frame->view;
  const geometry::Bounds& bounds = frame->surface->bounds();
  frame->forward = ToFloat(view.forward);
  frame->right = ToFloat(view.right);
  frame->up = ToFloat(view.up);
  const double eye_distance_m = (view.eye_m - bounds.Centre()).norm();
  const bool far_eye = eye_distance_m > kFarEyeRadii * 0.5 * bounds.DiagonalM();
  frame->start_depth_m = far_eye ? view.near_m : 0.0;
  frame->start = ToFloat(view.eye_m + frame->start_depth_m * view.forward);
  frame->start_right = ToFloat(frame->start_depth_m * view.right);
  frame->start_up = ToFloat(frame->start_depth_m * view.up);
}

CpuFrame MakeCpuFrame(const geometry::Surface& surface, const ShadingMesh& mesh, const Camera& camera,
                      const ImageOptions& options) {
  CpuFrame frame;
  frame.surface = &surface;
  frame.mesh = &mesh;
  const View view = MakeView(camera, surface.bounds(), options);
  frame.view = view;
  frame.box = ProjectBounds(view, surface.bounds());
  frame.lighting = MakeLighting(view, surface.bounds(), options.shading_style);
  frame.middle_x = 0.5 * view.width, frame.middle_y = 0.5 * view.height;
  frame.step_x = frame.step_y = view.step;
  frame.outside_only = mesh.outward && SeesOnlyOutside(view, surface.bounds());

  frame.sx.resize(view.width);
  frame.sy.resize(view.height);
  for (int x = 0; x < view.width; ++x)
    frame.sx[x] = static_cast<float>((x + 0.5 - 0.5 * view.width) * view.step);
  for (int y = 0; y < view.height; ++y)
    frame.sy[y] = static_cast<float>((0.5 * view.height - y - 0.5) * view.step);
  SetRays(&frame);
  return frame;
}

Visibility::Visibility(const PixelBox& pixel_box) : box(pixel_box) {
  const int columns = std::max(0, box.last_column - box.first_column);
  const int rows = std::max(0, box.last_row - box.first_row);
  stride = columns + kPadding;
  triangle.assign(static_cast<size_t>(rows) * stride, geometry::kNoTriangle);
}

}  // namespace touchstone::image
