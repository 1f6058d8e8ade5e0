// What a Surface finds contacts with: Embree's scene, which proposes quickly, and the tree for exact
// searches. Internal to geometry/.
#pragma once

#include <embree3/rtcore.h>

#include <Eigen/Geometry>

#include <atomic>
#include <cstring>
#include <memory>
#include <mutex>
#include <vector>

#include "server/geometry/surface/line_triangle.h"
#include "server/geometry/surface/surface.h"
#include "server/geometry/surface/triangle_tree.h"

namespace touchstone::geometry {

// A line in the mesh frame; travel counts from the origin.
struct Line {
  Eigen::Vector3d origin_m;
  Eigen::Vector3d direction;
};

struct Contact {
  double travel_m = 0;
  Eigen::Vector3d point_m;
  Eigen::Vector3d normal;
  uint32_t triangle = kNoTriangle;
};

inline void Store(const Contact& contact, size_t i, Contacts* contacts) {
  contacts->travel_m[i] = contact.travel_m;
  contacts->point_m[i] = contact.point_m;
  contacts->normal[i] = contact.normal;
  contacts->triangle[i] = contact.triangle;
}

// Whether two lines are the same, bit for bit. Plans in steps repeat poses, and repeated poses are sorted to
// stand side by side: their lines are cast once.
inline bool SameLine(absl::Span<const Eigen::Vector3d> origins_m,
                     absl::Span<const Eigen::Vector3d> directions, size_t a, size_t b) {
  // Words are loaded straight from the vectors: copied through the stack they cost as much as a tenth of a cast.
  const auto differences = [a, b](const Eigen::Vector3d* vectors) {
    const auto difference = [&](int axis) {
      uint64_t p, q;
      std::memcpy(&p, vectors[a].data() + axis, sizeof(p));
      std::memcpy(&q, vectors[b].data() + axis, sizeof(q));
      return p ^ q;
    };
    return difference(0) | difference(1) | difference(2);
  };
  return (differences(origins_m.data()) | differences(directions.data())) == 0;
}

inline void CopyContact(size_t from, size_t to, Contacts* contacts) {
  contacts->travel_m[to] = contacts->travel_m[from];
  contacts->point_m[to] = contacts->point_m[from];
  contacts->normal[to] = contacts->normal[from];
  contacts->triangle[to] = contacts->triangle[from];
}

class Surface::Search {
 public:
  // `mesh` must outlive the search. Builds Embree's scene.
  Search(const TriangleMesh& mesh, const Bounds& bounds);
  ~Search();

  // The line's first contact by definition: every triangle near the line is tested in double precision.
  // `earliest_m`: no contact comes before this travel.
  Contact CastExactly(const Line& line, double longest_m, double earliest_m = 0) const;

  // First contact of a sphere whose centre starts at line.origin_m; travel is the centre's and at most
  // longest_m. `travel_bound_m`: some contact is known to come no later (infinity: none known); `likely` is
  // the triangle of that one, or kNoTriangle.
  Contact SweepExactly(const Line& line, double radius_m, double longest_m, double travel_bound_m,
                       uint32_t likely) const;

  // As Surface::CastLines; the arrays have their size.
  void Cast(absl::Span<const Eigen::Vector3d> origins_m, absl::Span<const Eigen::Vector3d> directions,
            double longest_m, Contacts* contacts) const;

  double MeanCurvaturePerM(uint32_t triangle, const Eigen::Vector3d& point_m) const;

  RTCScene scene() const { return scene_; }
  uint64_t MemoryBytes() const;

 private:
  template <int kWidth>
  struct Packet;

  template <int kWidth>
  void CastPackets(absl::Span<const Eigen::Vector3d> origins_m, absl::Span<const Eigen::Vector3d> directions,
                   double longest_m, Contacts* contacts) const;
  template <int kWidth>
  void CastPacket(const Eigen::Vector3d* origins_m, const Eigen::Vector3d* directions, const uint32_t* lines,
                  int count, double longest_m, Contacts* contacts) const;
  // Rays start where the lines enter a sphere round the mesh, so that standing far away costs no precision.
  // Lanes from `count` on, and lines that pass the sphere by, are not valid.
  template <int kWidth>
  void StartRays(int count, double longest_m, Packet<kWidth>* packet) const;
  // The contacts of lanes k to k + 3 once Embree has proposed triangles, whose corners are given: the
  // proposal's where the line stays clear of the triangle's border and no other sheet is near, else by the
  // exact search.
  template <int kWidth>
  void ResolveLanes(const Packet<kWidth>& packet, const double (&corner)[9][kWidth], int k, int count,
                    double longest_m, const uint32_t* lines, Contacts* contacts) const;

  // Puts a triangle's coordinates into lane k: corner[3 * corner + axis][k].
  template <size_t kWidth>
  void LoadCorners(uint32_t triangle, int k, double (*corner)[kWidth]) const {
    const auto& vertices = mesh_.triangles[triangle];
    for (int c = 0; c < 3; ++c) {
      const Eigen::Vector3f& vertex = mesh_.vertices_m[vertices[c]];
      for (int axis = 0; axis < 3; ++axis) corner[3 * c + axis][k] = static_cast<double>(vertex[axis]);
    }
  }

  const TriangleTree& tree() const;  // built at the first call
  // Whether another sheet of the surface lies within the reach of rounding, so that Embree may take either.
  bool NearCoincident(uint32_t triangle) const;
  bool ComputeNearCoincident(uint32_t triangle) const;

  const TriangleMesh& mesh_;
  const Eigen::Vector3d centre_m_;
  double reach_m_ = 0;     // radius of a sphere round centre_m_ that holds the mesh
  double rounding_m_ = 0;  // what single precision may be off, anywhere near the mesh
  std::vector<Eigen::Vector3f> inflated_vertices_m_;  // what Embree sees: see VertexInflation
  RTCScene scene_ = nullptr;
  uint64_t scene_bytes_ = 0;
  mutable std::once_flag tree_once_;
  mutable std::unique_ptr<TriangleTree> tree_;
  mutable std::unique_ptr<std::atomic<uint8_t>[]> near_coincident_;  // see NearCoincident
  mutable std::once_flag curvature_once_;
  mutable std::vector<float> vertex_curvature_per_m_;
  mutable std::atomic<uint64_t> tree_bytes_{0}, curvature_bytes_{0};
};

// One for the process: Embree keeps its threads and instruction set there.
RTCDevice EmbreeDevice();
int EmbreePacketWidth();

// Mean curvature at every vertex, 1/m, positive where convex; 0 on borders and where it cannot be determined.
std::vector<float> VertexMeanCurvaturePerM(const TriangleMesh& mesh);

}  // namespace touchstone::geometry
