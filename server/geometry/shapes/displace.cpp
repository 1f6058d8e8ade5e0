#include "server/geometry/shapes/displace.h"

#include <absl/strings/str_cat.h>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <map>

namespace touchstone::geometry {
namespace {

// Below this share of the largest eigenvalue faces bend too little to say where their edge goes.
constexpr double kMinBend = 0.05;

using Edge = std::pair<uint32_t, uint32_t>;

Edge EdgeOf(uint32_t a, uint32_t b) {
  return {std::min(a, b), std::max(a, b)};
}

struct PlaceLess {
  bool operator()(const Eigen::Vector3f& a, const Eigen::Vector3f& b) const {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
  }
};

// One pass: halves every edge that is too long. Returns whether there was one.
bool HalveLongEdges(double max_edge_m, TriangleMesh* mesh) {
  std::map<Edge, uint32_t> middles;
  const auto middle = [&](uint32_t a, uint32_t b) -> int64_t {
    const Eigen::Vector3f &from = mesh->vertices_m[a], &to = mesh->vertices_m[b];
    if ((from - to).cast<double>().norm() <= max_edge_m) return -1;
    const auto [entry, is_new] =
        middles.emplace(EdgeOf(a, b), static_cast<uint32_t>(mesh->vertices_m.size()));
    if (is_new) {
      // The same place from either side, also where the two sides have vertices of their own.
      const Eigen::Vector3d sum = from.cast<double>() + to.cast<double>();
      mesh->vertices_m.push_back((0.5 * sum).cast<float>());
    }
    return entry->second;
  };
  std::vector<std::array<uint32_t, 3>> triangles;
  triangles.reserve(mesh->triangles.size());
  for (std::array<uint32_t, 3> t : mesh->triangles) {
    int64_t m[3];
    for (int c = 0; c < 3; ++c) m[c] = middle(t[c], t[(c + 1) % 3]);
    const int halved = (m[0] >= 0) + (m[1] >= 0) + (m[2] >= 0);
    // Turned so that edge 0 is halved, and with two of them edges 0 and 1.
    while (halved > 0 && halved < 3 && !(m[0] >= 0 && (halved == 1 || m[1] >= 0))) {
      std::rotate(t.begin(), t.begin() + 1, t.end());
      std::rotate(m, m + 1, m + 3);
    }
    const uint32_t m0 = static_cast<uint32_t>(m[0]), m1 = static_cast<uint32_t>(m[1]),
                   m2 = static_cast<uint32_t>(m[2]);
    const auto add = [&](uint32_t a, uint32_t b, uint32_t c) { triangles.push_back({a, b, c}); };
    if (halved == 0) add(t[0], t[1], t[2]);
    if (halved == 1) add(t[0], m0, t[2]), add(m0, t[1], t[2]);
    if (halved == 2) add(m0, t[1], m1), add(t[0], m0, m1), add(t[0], m1, t[2]);
    if (halved == 3) add(t[0], m0, m2), add(m0, t[1], m1), add(m2, m1, t[2]), add(m0, m1, m2);
  }
  mesh->triangles = std::move(triangles);
  return !middles.empty();
}

// The move d for which n . d is nearest to 1 for the faces' normals n, from sums over them.
Eigen::Vector3d UnitMove(const Eigen::Matrix3d& squares, const Eigen::Vector3d& sum) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(squares);
  Eigen::Vector3d move = Eigen::Vector3d::Zero();
  for (int i = 0; i < 3; ++i) {
    const double value = eigen.eigenvalues()[i];
    if (!(value > kMinBend * eigen.eigenvalues()[2]) || !(value > 0)) continue;
    const Eigen::Vector3d axis = eigen.eigenvectors().col(i);
    move += axis * (axis.dot(sum) / value);
  }
  return move;
}

}  // namespace

absl::StatusOr<TriangleMesh> WithShortEdges(TriangleMesh mesh, double max_edge_m, uint64_t max_triangles) {
  if (!(max_edge_m > 0)) return absl::InvalidArgumentError("the longest edge must be above 0");
  while (HalveLongEdges(max_edge_m, &mesh))
    if (mesh.triangles.size() > max_triangles)
      return absl::ResourceExhaustedError(absl::StrCat(
          "edges of ", max_edge_m * 1e3, " mm would take more than ", max_triangles, " triangles"));
  return mesh;
}

TriangleMesh MovedAlongNormals(TriangleMesh mesh,
                               const std::function<double(const Eigen::Vector3d& point_m)>& distance_m) {
  struct Faces {
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  };
  std::map<Eigen::Vector3f, Faces, PlaceLess> places;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d corner[3] = {mesh.Corner(t, 0), mesh.Corner(t, 1), mesh.Corner(t, 2)};
    if (IsDegenerate(corner[0], corner[1], corner[2])) continue;
    const Eigen::Vector3d normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]).stableNormalized();
    for (int c = 0; c < 3; ++c) {
      const Eigen::Vector3d to_next = corner[(c + 1) % 3] - corner[c],
                            to_last = corner[(c + 2) % 3] - corner[c];
      const double angle = std::atan2(to_next.cross(to_last).norm(), to_next.dot(to_last));
      Faces& faces = places[mesh.vertices_m[mesh.triangles[t][c]]];
      faces.squares += angle * normal * normal.transpose();
      faces.sum += angle * normal;
    }
  }
  for (Eigen::Vector3f& vertex : mesh.vertices_m) {
    const auto faces = places.find(vertex);
    if (faces == places.end()) continue;
    const Eigen::Vector3d place = vertex.cast<double>();
    vertex = (place + distance_m(place) * UnitMove(faces->second.squares, faces->second.sum)).cast<float>();
  }
  return mesh;
}

std::vector<double> AreaOfVertices(const TriangleMesh& mesh) {
  std::vector<double> area_m2(mesh.vertices_m.size(), 0);
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d a = mesh.Corner(t, 0);
    const double sixth = (mesh.Corner(t, 1) - a).cross(mesh.Corner(t, 2) - a).norm() / 6;
    for (const uint32_t v : mesh.triangles[t]) area_m2[v] += sixth;
  }
  return area_m2;
}

}  // namespace touchstone::geometry
