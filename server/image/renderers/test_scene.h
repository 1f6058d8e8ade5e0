// Meshes and an independent way to see them, for the tests of this folder.
#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/base/units.h"
#include "server/geometry/surface/surface.h"
#include "server/image/renderers/renderer.h"
#include "server/image/scene/view.h"

namespace touchstone::image {

// A sphere of 2 * rings * sectors triangles, less those at the poles; closed.
inline geometry::TriangleMesh BallMesh(double radius_m, uint32_t rings, uint32_t sectors) {
  geometry::TriangleMesh mesh;
  const auto add = [&mesh](double x, double y, double z) {
    mesh.vertices_m.emplace_back(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
  };
  add(0, 0, -radius_m);
  for (uint32_t ring = 1; ring < rings; ++ring) {
    const double latitude = kPi * (ring / double(rings) - 0.5);
    for (uint32_t sector = 0; sector < sectors; ++sector) {
      const double longitude = 2 * kPi * sector / sectors;
      add(radius_m * std::cos(latitude) * std::cos(longitude),
          radius_m * std::cos(latitude) * std::sin(longitude), radius_m * std::sin(latitude));
    }
  }
  add(0, 0, radius_m);
  const uint32_t top = static_cast<uint32_t>(mesh.vertices_m.size()) - 1;
  const auto at = [=](uint32_t ring, uint32_t sector) { return 1 + (ring - 1) * sectors + sector % sectors; };
  for (uint32_t sector = 0; sector < sectors; ++sector) {
    mesh.triangles.push_back({0, at(1, sector + 1), at(1, sector)});
    for (uint32_t ring = 1; ring + 1 < rings; ++ring) {
      mesh.triangles.push_back({at(ring, sector), at(ring, sector + 1), at(ring + 1, sector + 1)});
      mesh.triangles.push_back({at(ring, sector), at(ring + 1, sector + 1), at(ring + 1, sector)});
    }
    mesh.triangles.push_back({at(rings - 1, sector), at(rings - 1, sector + 1), top});
  }
  return mesh;
}

// Adds a closed box.
inline void AddBox(const Eigen::Vector3d& min_m, const Eigen::Vector3d& max_m, geometry::TriangleMesh* mesh) {
  const uint32_t first = static_cast<uint32_t>(mesh->vertices_m.size());
  for (uint32_t corner = 0; corner < 8; ++corner) {
    mesh->vertices_m.push_back(Eigen::Vector3d((corner & 1) ? max_m.x() : min_m.x(),
                                               (corner & 2) ? max_m.y() : min_m.y(),
                                               (corner & 4) ? max_m.z() : min_m.z())
                                   .cast<float>());
  }
  // Corners of each face, counter-clockwise from outside.
  constexpr uint32_t kFaces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                     {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (const uint32_t(&face)[4] : kFaces) {
    mesh->triangles.push_back({first + face[0], first + face[1], first + face[2]});
    mesh->triangles.push_back({first + face[0], first + face[2], first + face[3]});
  }
}

// Boxes that touch nowhere and look different from every side: a letter F without joints.
inline geometry::TriangleMesh LetterMesh() {
  geometry::TriangleMesh mesh;
  AddBox({-0.05, -0.02, -0.06}, {-0.02, 0.02, 0.06}, &mesh);
  AddBox({-0.015, -0.02, 0.035}, {0.05, 0.02, 0.06}, &mesh);
  AddBox({-0.015, -0.01, -0.005}, {0.03, 0.02, 0.015}, &mesh);
  return mesh;
}

// The lower half of a sphere: open, seen from inside and outside.
inline geometry::TriangleMesh BowlMesh() {
  geometry::TriangleMesh ball = BallMesh(0.06, 24, 30), bowl;
  bowl.vertices_m = ball.vertices_m;
  for (const auto& triangle : ball.triangles) {
    float highest = -1;
    for (uint32_t vertex : triangle) highest = std::max(highest, ball.vertices_m[vertex].z());
    if (highest < 0.001f) bowl.triangles.push_back(triangle);
  }
  return bowl;
}

inline geometry::TriangleMesh InsideOut(geometry::TriangleMesh mesh) {
  for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
  return mesh;
}

inline std::shared_ptr<const geometry::Surface> MakeSurface(const char* name, geometry::TriangleMesh mesh) {
  auto surface = geometry::Surface::Create(name, std::move(mesh));
  if (!surface.ok()) {
    ADD_FAILURE() << surface.status().message();
    return nullptr;
  }
  return *surface;
}

inline Camera CameraAt(const Eigen::Vector3d& eye_m) {
  Camera camera;
  camera.eye_m = eye_m;
  return camera;
}

// What renderers are tried on: closed and open meshes, seen from outside, from inside, cut, and from far
// away.
struct Scene {
  const char* name;
  geometry::TriangleMesh mesh;
  Camera camera;
};

inline std::vector<Scene> Scenes() {
  std::vector<Scene> scenes;
  scenes.push_back({"letter", LetterMesh(), CameraAt({0.12, -0.26, 0.09})});
  scenes.push_back({"ball", BallMesh(0.07, 14, 20), CameraAt({0.2, 0.05, 0.1})});
  scenes.push_back({"bowl from above", BowlMesh(), CameraAt({0.05, 0.08, 0.2})});
  scenes.push_back({"bowl from below", BowlMesh(), CameraAt({0.15, 0.08, -0.2})});
  scenes.push_back({"inside out", InsideOut(LetterMesh()), CameraAt({-0.25, -0.1, -0.12})});
  scenes.push_back({"from within", BallMesh(0.07, 14, 20), CameraAt({0.03, 0.01, 0.02})});
  // Cut open by the near plane, and cut off by the far one.
  Camera cut = CameraAt({0.2, -0.1, 0.05});
  cut.near_m = 0.21;
  cut.far_m = 0.27;
  scenes.push_back({"cut", BallMesh(0.07, 14, 20), cut});
  // A long lens, far away.
  Camera far = CameraAt({30, -20, 10});
  far.vertical_fov_rad = 0.005;
  scenes.push_back({"far away", LetterMesh(), far});
  return scenes;
}

inline ImageOptions WithAll(int width, int height) {
  ImageOptions options;
  options.width = width;
  options.height = height;
  options.depth = true;
  options.mask = true;
  return options;
}

// What the ray from the eye through an image point (pixels, fractions allowed) meets first: every triangle is
// tried, in double precision.
struct SeenPoint {
  uint32_t triangle = geometry::kNoTriangle;
  double depth_m = std::numeric_limits<double>::infinity();
};
inline SeenPoint LookAtPixel(const geometry::TriangleMesh& mesh, const View& view, double x, double y) {
  const Eigen::Vector3d direction = view.forward + (x - 0.5 * view.width) * view.step * view.right +
                                    (0.5 * view.height - y) * view.step * view.up;
  SeenPoint seen;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d a = mesh.Corner(t, 0);
    const Eigen::Vector3d e1 = mesh.Corner(t, 1) - a, e2 = mesh.Corner(t, 2) - a, s = view.eye_m - a;
    const Eigen::Vector3d p = direction.cross(e2), q = s.cross(e1);
    const double determinant = e1.dot(p);
    if (determinant == 0) continue;
    const double u = s.dot(p) / determinant, v = direction.dot(q) / determinant,
                 depth_m = e2.dot(q) / determinant;
    if (u < 0 || v < 0 || u + v > 1 || depth_m < view.near_m || depth_m > view.far_m) continue;
    if (depth_m < seen.depth_m) seen = {t, depth_m};
  }
  return seen;
}

// Whether the picture is the same all around the point: no silhouette, no edge within `radius` pixels (as far
// as four points tell).
inline bool IsSteady(const geometry::TriangleMesh& mesh, const View& view, double x, double y, double radius,
                     bool same_face) {
  const SeenPoint centre = LookAtPixel(mesh, view, x, y);
  for (const auto& [dx, dy] : {std::pair(-1, -1), std::pair(-1, 1), std::pair(1, -1), std::pair(1, 1)}) {
    const SeenPoint beside = LookAtPixel(mesh, view, x + radius * dx, y + radius * dy);
    if ((beside.triangle == geometry::kNoTriangle) != (centre.triangle == geometry::kNoTriangle))
      return false;
    if (same_face && beside.triangle != centre.triangle) return false;
  }
  return true;
}

// The renderer of that name, or null with the reason why it cannot be had here.
inline std::shared_ptr<Renderer> RendererNamed(const std::string& name, std::string* reason) {
  RendererOptions options;
  options.kind = name == "cpu" ? RendererKind::kCpu : RendererKind::kEgl;
  absl::StatusOr<std::shared_ptr<Renderer>> renderer = CreateRenderer(options);
  if (renderer.ok()) return *renderer;
  *reason = std::string(renderer.status().message());
  return nullptr;
}

}  // namespace touchstone::image
