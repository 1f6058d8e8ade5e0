// What the parts of the CPU renderer share: one image's request in single precision, and the triangle that is
// seen in each pixel. Part of the CPU renderer only.
#pragma once

#include <cstdint>
#include <vector>

#include "server/geometry/surface/surface.h"
#include "server/image/renderers/cpu_kernels.h"
#include "server/image/renderers/renderer.h"
#include "server/image/scene/shading.h"
#include "server/image/scene/shading_mesh.h"
#include "server/image/scene/view.h"

namespace touchstone::image {

struct Vec3f {
  float x, y, z;
};

// All that stays the same over one image.
struct CpuFrame {
  const geometry::Surface* surface;
  const ShadingMesh* mesh;
  View view;
  PixelBox box;  // outside it there is no object
  Lighting lighting;
  bool outside_only;  // back faces cannot be seen and need not be looked at

  // Pixel of a point of the camera: middle + (right, down) / (depth * step).
  double middle_x, middle_y;
  double step_x, step_y;

  // The ray of a pixel with slopes sx, sy: origin = start + sx * start_right + sy * start_up,
  // direction = forward + sx * right + sy * up.
  std::vector<float> sx, sy;  // by column and by row
  Vec3f forward, right, up;
  Vec3f start, start_right, start_up;
  double start_depth_m;  // of the origins: 0 or the near plane's
};

// Up to this many radii of the object's bounding sphere away, rays start at the eye: Embree culls packets
// best when they share an origin. From farther, single precision would blur the object, and rays start on the
// near plane.
inline constexpr double kFarEyeRadii = 100;

CpuFrame MakeCpuFrame(const geometry::Surface& surface, const ShadingMesh& mesh, const Camera& camera,
                      const ImageOptions& options);

// The rays of a frame whose view and surface are set: forward to start_depth_m.
void SetRays(CpuFrame* frame);

// The triangle seen through each pixel's centre, for the pixels of a frame's box.
struct Visibility {
  static constexpr int kPadding =
      kKernelWidth;  // columns beyond the box that may be written, and mean nothing

  explicit Visibility(const PixelBox& pixel_box);
  uint32_t* Row(int row) { return &triangle[static_cast<size_t>(row - box.first_row) * stride]; }

  PixelBox box;
  int stride = 0;                  // of a row
  std::vector<uint32_t> triangle;  // kNoTriangle: none
};

// Two ways to find it. Rays (Embree packets) cost the same for every pixel and hardly more for more
// triangles; drawing triangles costs the same for every triangle and hardly more for more pixels.
void CastPixels(const CpuFrame& frame, Visibility* visibility);  // visibility_rays.cpp
void DrawTriangles(const CpuFrame& frame, const CpuKernels& kernels,
                   Visibility* visibility);  // visibility_triangles.cpp

// Whether drawing is the faster way.
bool IsCoarse(const CpuFrame& frame);
// Whether triangles can be drawn as they are, without clipping, in single precision.
bool CanDrawTriangles(const CpuFrame& frame);

// Shades what is seen into the image, whose arrays have their background already.
void ShadeVisible(const CpuFrame& frame, const CpuKernels& kernels, Visibility& visibility,
                  Image* image);  // cpu_shading.cpp

// The frame's mesh as kernels read it.
DrawnMesh DrawnMeshOf(const CpuFrame& frame);

// The CPU renderer with kernels of one's choice, for tests.
std::shared_ptr<Renderer> CreateCpuRendererOf(const CpuKernels& kernels);  // renderer_cpu.cpp

}  // namespace touchstone::image
