// The simplest way of finding a contact: a segment against every triangle (Ericson, Real-Time Collision
// Detection, 5.3.6), single precision, no acceleration.
#pragma once

#include "server/geometry/mesh/mesh.h"

namespace touchstone::bench {

// Smallest travel along the segment origin .. origin + length_m * direction; length_m if nothing is met.
inline float BruteForceTravel(const geometry::TriangleMesh& mesh, const Eigen::Vector3d& origin_m,
                              const Eigen::Vector3d& direction, float length_m) {
  const Eigen::Vector3f p = origin_m.cast<float>();
  const Eigen::Vector3f qp = -direction.cast<float>() * length_m;
  float min_fraction = 1;
  for (const auto& triangle : mesh.triangles) {
    const Eigen::Vector3f& a = mesh.vertices_m[triangle[0]];
    const Eigen::Vector3f ab = mesh.vertices_m[triangle[1]] - a;
    const Eigen::Vector3f ac = mesh.vertices_m[triangle[2]] - a;
    const Eigen::Vector3f normal = ab.cross(ac);
    const float d = qp.dot(normal);
    if (d <= 0) continue;
    const Eigen::Vector3f ap = p - a;
    const float t = ap.dot(normal);
    if (t < 0 || t > d * min_fraction) continue;
    const Eigen::Vector3f e = qp.cross(ap);
    const float v = ac.dot(e);
    if (v < 0 || v > d) continue;
    const float w = -ab.dot(e);
    if (w < 0 || v + w > d) continue;
    min_fraction = t / d;
  }
  return min_fraction * length_m;
}

}  // namespace touchstone::bench
