// A triangle mesh in the object frame (right-handed, z up), in metres.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace touchstone::geometry {

struct TriangleMesh {
  std::vector<Eigen::Vector3f> vertices_m;
  std::vector<std::array<uint32_t, 3>>
      triangles;  // counter-clockwise seen from outside, indices into vertices_m

  // Corner c (0, 1, 2) of a triangle, exactly as stored, in double precision.
  Eigen::Vector3d Corner(uint32_t triangle, int c) const {
    return vertices_m[triangles[triangle][c]].cast<double>();
  }
};

// The axis-aligned box around a mesh's triangles; vertices that no triangle uses do not count, a finger
// cannot touch them. Without triangles: min > max.
struct Bounds {
  Eigen::Vector3d min_m = Eigen::Vector3d::Constant(1e300);
  Eigen::Vector3d max_m = Eigen::Vector3d::Constant(-1e300);
  Eigen::Vector3d Centre() const { return 0.5 * (min_m + max_m); }
  double DiagonalM() const { return (max_m - min_m).norm(); }
};

Bounds ComputeBounds(const TriangleMesh& mesh);

// How far it is from a point along a unit vector to where that ray leaves the box for good; 0: it does not meet the box.
double DistanceToLeave(const Bounds& bounds, const Eigen::Vector3d& point_m,
                       const Eigen::Vector3d& direction);

// What a mesh is like, for `mesh info` and for refusing what cannot be touched. Edges, duplicates and
// degeneracy are judged by position: vertices at exactly the same place are one, so that a seam of textures
// or a triangle soup does not read as a hole. A triangle with two corners at one place has no edges.
struct MeshReport {
  uint64_t vertices = 0;
  uint64_t triangles = 0;
  uint64_t boundary_edges = 0;        // edges with one triangle: the surface is open there
  uint64_t nonmanifold_edges = 0;     // edges with three triangles or more
  uint64_t inconsistent_edges = 0;    // edges that both triangles run through in the same direction
  uint64_t degenerate_triangles = 0;  // zero area: equal or exactly collinear corners
  uint64_t duplicate_triangles = 0;   // the same three corners as an earlier triangle, in any order
  uint64_t unused_vertices = 0;
  double signed_volume_m3 = 0;  // negative: inside out
  bool closed() const { return boundary_edges == 0 && nonmanifold_edges == 0; }
};

MeshReport InspectMesh(const TriangleMesh& mesh);

// The mesh without triangles of zero area and without those that repeat the corners of an earlier one, in the
// order in which they stood; vertices stay as they are.
TriangleMesh WithoutDegenerateAndDuplicate(TriangleMesh mesh);

// For every vertex the first vertex at the same place, to the last bit.
std::vector<uint32_t> FirstAtSamePlace(const std::vector<Eigen::Vector3f>& vertices_m);

// Whether three points span no area, judged in double precision.
bool IsDegenerate(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c);

// SHA-256 of the two counts and the vertex and index bytes, little-endian: the identity of a mesh in
// datasets, sessions and reports.
std::string MeshHash(const TriangleMesh& mesh);

}  // namespace touchstone::geometry
