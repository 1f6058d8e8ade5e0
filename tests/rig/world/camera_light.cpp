#include "tests/rig/world/camera_light.h"

#include <algorithm>

namespace touchstone::rig {
namespace {

constexpr double kAmbientLight = 0.07, kFarM = 10;
// In the image's axes (right, up, towards the eye), multiples of the bounding sphere's radius from its centre.
struct Lamp {
  double right, up, towards_eye, strength;
};
constexpr Lamp kLamps[] = {{-3.5, 4.0, 4.0, 0.88}, {4.0, -1.0, 2.5, 0.26}};

Eigen::Vector3d VectorOf(const float (&v)[3]) {
  return {v[0], v[1], v[2]};
}

// Between the normals of the triangle's corners; not of unit length.
Eigen::Vector3d NormalAt(const image::ShadingMesh& mesh, uint32_t triangle, const Eigen::Vector3d& point) {
  const image::ShadingMesh::Vertex* corner[3];
  for (int c = 0; c < 3; ++c) corner[c] = &mesh.vertices[mesh.corners[3 * triangle + c]];
  const Eigen::Vector3d a = VectorOf(corner[0]->position_m), ab = VectorOf(corner[1]->position_m) - a,
                        ac = VectorOf(corner[2]->position_m) - a, ap = point - a, n = ab.cross(ac);
  const double area = n.squaredNorm();
  const double beta = ap.cross(ac).dot(n) / area, gamma = ab.cross(ap).dot(n) / area;
  return (1 - beta - gamma) * VectorOf(corner[0]->normal) + beta * VectorOf(corner[1]->normal) +
         gamma * VectorOf(corner[2]->normal);
}

}  // namespace

CameraLight::CameraLight(std::shared_ptr<const geometry::Surface> surface)
    : surface_(std::move(surface)), shading_(image::MakeShadingMesh(*surface_)) {}

std::vector<double> CameraLight::Along(const std::vector<Eigen::Vector2d>& rays,
                                       const Eigen::Affine3d& from_camera, const Eigen::Affine3d& lights_from,
                                       double ground) const {
  const Eigen::Vector3d nowhere(0, 0, -1);  // of a ray that a lens cannot bend so far
  const std::vector<Eigen::Vector3d> eyes(rays.size(), from_camera.translation());
  std::vector<Eigen::Vector3d> directions;
  directions.reserve(rays.size());
  for (const Eigen::Vector2d& ray : rays) {
    const Eigen::Vector3d ahead(ray.x(), ray.y(), 1);
    directions.push_back((from_camera.linear() * (ray.allFinite() ? ahead : nowhere)).normalized());
  }
  geometry::Contacts contacts;
  surface_->CastLines(eyes, directions, kFarM, &contacts);
  const double radius_m = 0.5 * surface_->bounds().DiagonalM();
  Eigen::Vector3d lamps[2];
  for (int k = 0; k < 2; ++k)
    lamps[k] = surface_->bounds().Centre() +
               radius_m * (lights_from.linear() *
                           Eigen::Vector3d(kLamps[k].right, -kLamps[k].up, -kLamps[k].towards_eye));
  std::vector<double> light(rays.size(), ground);
  for (size_t k = 0; k < rays.size(); ++k) {
    if (contacts.triangle[k] == geometry::kNoTriangle || !rays[k].allFinite()) continue;
    Eigen::Vector3d normal = NormalAt(shading_, contacts.triangle[k], contacts.point_m[k]);
    if (!shading_.outward && contacts.normal[k].dot(normal) < 0) normal = -normal;
    double shade = kAmbientLight;
    for (int i = 0; i < 2; ++i) {
      const Eigen::Vector3d to_lamp = lamps[i] - contacts.point_m[k];
      shade += kLamps[i].strength * std::max(0.0, normal.dot(to_lamp) / (normal.norm() * to_lamp.norm()));
    }
    light[k] = std::min(1.0, shade);
  }
  return light;
}

}  // namespace touchstone::rig
