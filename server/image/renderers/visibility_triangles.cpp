// Triangles drawn into a depth buffer. All arithmetic is plain single precision in a fixed order (cpu_kernels.h): the
// result does not depend on the machine.
#include <array>
#include <cmath>

#include "server/image/renderers/cpu_frame.h"

namespace touchstone::image {
namespace {

// Up to this many triangles for a pixel of the object's box, drawing is faster than casting: measured, 2.7
// times as fast at one or two, 1.4 times at 27; open meshes, which show both sides, gain less.
constexpr double kTrianglesAPixel = 20.0;

// One row of the matrix that projects: the vector, and what it makes of the eye.
void SetRow(const Eigen::Vector3d& axis, const Eigen::Vector3d& eye_m, float* row) {
  // Composed in double precision: what is large cancels before it is rounded.
  for (int i = 0; i < 3; ++i) row[i] = static_cast<float>(axis[i]);
  row[3] = static_cast<float>(-axis.dot(eye_m));
}

}  // namespace

bool IsCoarse(const CpuFrame& frame) {
  const double pixels = static_cast<double>(frame.box.last_column - frame.box.first_column) *
                        (frame.box.last_row - frame.box.first_row);
  return static_cast<double>(frame.mesh->corners.size() / 3) <= kTrianglesAPixel * pixels;
}

bool CanDrawTriangles(const CpuFrame& frame) {
  // Nothing to be clipped, no corner so far beside the image that its pixel is blurred, and depths that
  // differ.
  const geometry::Bounds& bounds = frame.surface->bounds();
  if (frame.start_depth_m != 0) return false;  // a far eye
  constexpr double kFarthestPixel = 8192;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d corner_m((i & 1) ? bounds.max_m.x() : bounds.min_m.x(),
                                   (i & 2) ? bounds.max_m.y() : bounds.min_m.y(),
                                   (i & 4) ? bounds.max_m.z() : bounds.min_m.z());
    const double depth_m = frame.view.DepthM(corner_m);
    if (depth_m < frame.view.near_m || depth_m > frame.view.far_m) return false;
    const Eigen::Vector3d from_eye = corner_m - frame.view.eye_m;
    if (std::abs(frame.middle_x + from_eye.dot(frame.view.right) / (depth_m * frame.step_x)) >
            kFarthestPixel ||
        std::abs(frame.middle_y - from_eye.dot(frame.view.up) / (depth_m * frame.step_y)) > kFarthestPixel)
      return false;
  }
  return true;
}

DrawnMesh DrawnMeshOf(const CpuFrame& frame) {
  static_assert(sizeof(ShadingMesh::Vertex) == 6 * sizeof(float), "read as six floats");
  const ShadingMesh& mesh = *frame.mesh;
  return {mesh.vertices.empty() ? nullptr : mesh.vertices.front().position_m, mesh.corners.data(),
          static_cast<uint32_t>(mesh.vertices.size()), static_cast<uint32_t>(mesh.corners.size() / 3)};
}

void DrawTriangles(const CpuFrame& frame, const CpuKernels& kernels, Visibility* visibility) {
  const View& view = frame.view;
  ProjectionRows rows;
  SetRow(view.right / frame.step_x, view.eye_m, rows.right);
  SetRow(-view.up / frame.step_y, view.eye_m, rows.down);
  SetRow(view.forward, view.eye_m, rows.forward);
  rows.middle_x = static_cast<float>(frame.middle_x);
  rows.middle_y = static_cast<float>(frame.middle_y);

  const DrawnMesh mesh = DrawnMeshOf(frame);
  // Kept from picture to picture: fresh memory would cost more than the arithmetic.
  thread_local std::array<std::vector<float>, 3> vertices;
  thread_local std::vector<float> nearest;
  thread_local std::vector<uint32_t> candidates;
  for (std::vector<float>& coordinate : vertices) coordinate.resize(mesh.vertex_count);
  nearest.assign(visibility->triangle.size(), 0.0f);
  candidates.resize(mesh.triangle_count + kKernelWidth);
  const ProjectedVertices projected = {vertices[0].data(), vertices[1].data(), vertices[2].data()};
  kernels.project(rows, mesh, projected);
  const PixelBox& box = frame.box;
  kernels.draw(mesh, projected, frame.outside_only, candidates.data(),
               {box.first_column, box.first_row, box.last_column, box.last_row, visibility->stride,
                nearest.data(), visibility->triangle.data()});
}

}  // namespace touchstone::image
