// What each pixel of a photograph sees: points of the surface with their normals, found by rays along the lens's own
// viewing directions. Part of the simulation of photographs only.
//
// All in the frame and scale of the mesh: a surface that effects move is photographed by a camera moved the other way.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "server/effects/photo_settings.h"
#include "server/geometry/surface/surface.h"
#include "server/image/photograph/photo_lens.h"
#include "server/image/renderers/cpu_frame.h"
#include "server/image/scene/shading_mesh.h"

namespace touchstone::image {

// Where the surface of a photograph really is: point = translation + rotation * (scale * mesh point).
struct SurfacePlace {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();

  Eigen::Vector3d ToMesh(const Eigen::Vector3d& point_m) const {
    return rotation.transpose() * (point_m - translation_m) / scale;
  }
};

// The camera as it stands, before the mesh.
struct PhotoCamera {
  Eigen::Vector3d eye_m, right, up, forward;  // mesh frame; unit vectors
  double near_m = 0, far_m = 0;               // depths in the mesh's scale
  double scale = 1;                           // metres of depth per metre of the mesh
};
PhotoCamera RealCamera(const Camera& commanded, const effects::PhotoSettings& settings,
                       const SurfacePlace& place, const geometry::Bounds& bounds);

// The pixels that see the surface, row by row, an entry each.
struct PhotoPoints {
  int count = 0;
  PixelBox box;                    // that just holds them; empty where there are none
  std::vector<int> pixel;          // row * width + column
  std::vector<uint32_t> triangle;  // that is seen
  std::array<std::vector<float>, 3> point_m;
  std::array<std::vector<float>, 3> normal;  // unit, interpolated, turned with the face towards the viewer
  std::array<std::vector<float>, 3> face;    // unit normal of the flat triangle, towards the viewer
  std::array<std::vector<float>, 3> to_eye;  // unit
  std::vector<float> depth_m;                // along the viewing axis, real scale
  std::vector<float> cos_incidence;          // between the way to the eye and the normal, 0 to 1
  void Resize(int new_count);
};
void FindPoints(const geometry::Surface& surface, const ShadingMesh& mesh, const PhotoCamera& camera,
                const PhotoLens& lens, const PixelSlopes& slopes, PhotoPoints* points);

}  // namespace touchstone::image
