// A mesh that fingers can touch: exact first contact of lines (point finger tips) and of swept spheres
// (sphere tips). The only files that include Embree are the ones beside this header.
//
// A contact is defined in double precision: the least travel over all triangles that the line meets (borders
// included), and among equals the smallest triangle number. Embree, in single precision, only proposes; where
// it could be wrong (line_triangle.h, ray_cast.cpp) the triangles near the line are searched exactly. So a
// result is a pure function of the line and the mesh, bit for bit, whatever other lines stood in the same
// call, however many threads called and whatever instructions the machine has.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/types/span.h>
#include <Eigen/Core>

#include "server/geometry/mesh/mesh.h"

namespace touchstone::geometry {

inline constexpr uint32_t kNoTriangle = 0xFFFFFFFFu;

// First contacts, one entry per line. Arrays are resized by the call and reused between calls.
struct Contacts {
  std::vector<double> travel_m;          // from the line's origin along its direction; NaN: no contact
  std::vector<Eigen::Vector3d> normal;   // unit, from the surface towards the finger; zero on a miss
  std::vector<Eigen::Vector3d> point_m;  // on the surface, mesh frame; NaN on a miss
  std::vector<uint32_t> triangle;        // kNoTriangle on a miss
  void Resize(size_t count);
};

class Surface {
 public:
  // Builds the BVH (all cores). Triangles keep their order. Fails on a mesh without a triangle of positive
  // area, with an index out of range, with a coordinate that is not finite, or with more than kMaxTriangles
  // triangles. Degenerate and exactly repeated triangles are dropped first: mesh() is what is left.
  static absl::StatusOr<std::shared_ptr<const Surface>> Create(std::string name, TriangleMesh mesh);
  ~Surface();

  static constexpr uint64_t kMaxTriangles = 4'000'000;

  const std::string& name() const { return name_; }
  const std::string& hash() const { return hash_; }
  const TriangleMesh& mesh() const { return mesh_; }
  const Bounds& bounds() const { return bounds_; }

  // First contact of each line origin + t * direction, 0 < t <= longest_m. Directions are unit vectors; all
  // coordinates in the mesh frame, metres. Both faces of a triangle count; `normal` is turned against the
  // direction. Lines that stand near each other should be neighbours in the arrays (packets of 16).
  void CastLines(absl::Span<const Eigen::Vector3d> origins_m, absl::Span<const Eigen::Vector3d> directions,
                 double longest_m, Contacts* contacts) const;

  // The same for spheres of radius_m (> 0) whose centre runs along the line: travel_m is what the *foremost
  // point* of the sphere has gone when the sphere first touches, that is, the centre starts radius_m behind
  // the origin: centre(t) = origin + (t - radius_m) * direction. On a plane met at right angles the result
  // equals CastLines'. Exact to 1 um on faces, edges and vertices of any mesh. `normal` points from the
  // contact to the centre. A sphere that touches or overlaps the surface where it starts has travel 0, and
  // the point and the normal of the nearest spot of the surface; so here 0 <= travel_m <= longest_m.
  void SweepSpheres(absl::Span<const Eigen::Vector3d> origins_m, absl::Span<const Eigen::Vector3d> directions,
                    double radius_m, double longest_m, Contacts* contacts) const;

  // Mean curvature in 1/m at a point of a triangle, positive where the surface is convex: interpolated from
  // the vertices' cotangent Laplacian (Meyer et al. 2003). Computed for the whole mesh at the first call.
  double MeanCurvaturePerM(uint32_t triangle, const Eigen::Vector3d& point_m) const;

  // Embree's scene handle, for the CPU renderer of image/ alone (an RTCScene). Its vertices stand off the
  // mesh's by less than a millionth of the mesh's size.
  void* embree_scene() const;

  // Bytes held by mesh and BVH together.
  uint64_t MemoryBytes() const;

 private:
  Surface();
  class Search;  // what finds contacts: search.h

  std::string name_;
  std::string hash_;
  TriangleMesh mesh_;
  Bounds bounds_;
  std::unique_ptr<Search> search_;
};

// "AVX2", "AVX512", ... and the packet width used, for `doctor`.
std::string EmbreeDescription();

}  // namespace touchstone::geometry
