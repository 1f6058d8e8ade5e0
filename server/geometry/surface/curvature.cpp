// Mean curvature at the vertices: the cotangent Laplacian over the mixed area (Meyer, Desbrun, Schroeder,
// Barr, "Discrete differential-geometry operators for triangulated 2-manifolds", 2003).
#include <algorithm>
#include <cmath>

#include "server/geometry/surface/search.h"

namespace touchstone::geometry {

std::vector<float> VertexMeanCurvaturePerM(const TriangleMesh& mesh) {
  const size_t count = mesh.vertices_m.size();
  std::vector<Eigen::Vector3f> pull(count,
                                    Eigen::Vector3f::Zero());  // sum of (cot + cot) * edge, inwards if convex
  std::vector<Eigen::Vector3f> normal(count, Eigen::Vector3f::Zero());  // by angle
  std::vector<Eigen::Vector3f> loop(count, Eigen::Vector3f::Zero());  // opposite edges: zero inside a surface
  std::vector<float> area(count, 0), opposite(count, 0);
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d corner[3] = {mesh.Corner(t, 0), mesh.Corner(t, 1), mesh.Corner(t, 2)};
    const Eigen::Vector3d area_vector = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
    const double twice_area = area_vector.stableNorm();
    const Eigen::Vector3d unit = area_vector.stableNormalized();
    double cotangent[3], angle[3];
    for (int c = 0; c < 3; ++c) {
      const Eigen::Vector3d to_next = corner[(c + 1) % 3] - corner[c],
                            to_last = corner[(c + 2) % 3] - corner[c];
      const double cosine = to_next.dot(to_last);
      angle[c] = std::atan2(twice_area, cosine);
      // A needle's cotangent would drown its neighbours.
      cotangent[c] = std::clamp(cosine / twice_area, -100.0, 100.0);
    }
    const bool obtuse = cotangent[0] < 0 || cotangent[1] < 0 || cotangent[2] < 0;
    for (int c = 0; c < 3; ++c) {
      const int next = (c + 1) % 3, last = (c + 2) % 3;
      const uint32_t v = mesh.triangles[t][c];
      const Eigen::Vector3d to_next = corner[next] - corner[c], to_last = corner[last] - corner[c];
      pull[v] += (cotangent[last] * to_next + cotangent[next] * to_last).cast<float>();
      normal[v] += (angle[c] * unit).cast<float>();
      loop[v] += (to_last - to_next).cast<float>();
      opposite[v] += static_cast<float>((to_last - to_next).norm());
      area[v] += static_cast<float>(obtuse ? twice_area * (cotangent[c] < 0 ? 0.25 : 0.125)
                                           : 0.125 * (cotangent[last] * to_next.squaredNorm() +
                                                      cotangent[next] * to_last.squaredNorm()));
    }
  }
  std::vector<float> curvature(count, 0);
  for (size_t v = 0; v < count; ++v) {
    // On a border the sum has no meaning.
    if (!(area[v] > 0) || loop[v].norm() > 1e-4f * opposite[v]) continue;
    // The Laplacian is -2 H n, and pull / (2 area) approximates it.
    const float value = -pull[v].dot(normal[v].stableNormalized()) / (4 * area[v]);
    // A mesh cannot show a radius much smaller than its triangles.
    const float limit = 4 / std::sqrt(area[v]);
    if (std::isfinite(value)) curvature[v] = std::clamp(value, -limit, limit);
  }
  return curvature;
}

double Surface::Search::MeanCurvaturePerM(uint32_t triangle, const Eigen::Vector3d& point_m) const {
  std::call_once(curvature_once_, [this] {
    vertex_curvature_per_m_ = VertexMeanCurvaturePerM(mesh_);
    curvature_bytes_.store(vertex_curvature_per_m_.capacity() * sizeof(float), std::memory_order_release);
  });
  // Barycentric coordinates of the point's projection, kept inside the triangle.
  const Eigen::Vector3d a = mesh_.Corner(triangle, 0), b = mesh_.Corner(triangle, 1),
                        c = mesh_.Corner(triangle, 2);
  const Eigen::Vector3d area = (b - a).cross(c - a);
  double weight[3] = {(b - point_m).cross(c - point_m).dot(area), (c - point_m).cross(a - point_m).dot(area),
                      (a - point_m).cross(b - point_m).dot(area)};
  double sum = 0, value = 0;
  for (int i = 0; i < 3; ++i) {
    weight[i] = std::max(0.0, weight[i]);
    sum += weight[i];
    value += weight[i] * vertex_curvature_per_m_[mesh_.triangles[triangle][i]];
  }
  return sum > 0 ? value / sum : 0;
}

}  // namespace touchstone::geometry
