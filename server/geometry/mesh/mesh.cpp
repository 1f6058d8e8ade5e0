#include "server/geometry/mesh/mesh.h"

#include <absl/container/flat_hash_map.h>
#include <absl/container/flat_hash_set.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "server/base/check.h"
#include "server/base/text/text.h"
#include "server/geometry/mesh/pieces.h"

namespace touchstone::geometry {
namespace {

// The bits of a position; -0 and 0 are the same place.
using PositionBits = std::array<uint32_t, 3>;

PositionBits BitsOf(const Eigen::Vector3f& position) {
  PositionBits bits;
  for (int k = 0; k < 3; ++k) {
    const float value = position[k] + 0.0f;
    std::memcpy(&bits[k], &value, sizeof value);
  }
  return bits;
}

uint64_t Mix(uint64_t x) {  // the finaliser of SplitMix64
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
  return x ^ (x >> 31);
}

// A bit for each of many keys; two keys may share one.
class KeyBits {
 public:
  explicit KeyBits(size_t keys) {
    size_t bits = 1024;
    while (bits < 16 * keys) bits *= 2;
    words_.resize(bits / 64);
    mask_ = bits - 1;
  }
  bool Has(uint64_t key) const { return (words_[(key & mask_) / 64] >> (key % 64)) & 1; }
  void Set(uint64_t key) { words_[(key & mask_) / 64] |= uint64_t{1} << (key % 64); }

 private:
  std::vector<uint64_t> words_;
  uint64_t mask_;
};

std::array<PositionBits, 3> SortedPlaces(const TriangleMesh& mesh, uint32_t triangle) {
  std::array<PositionBits, 3> places;
  for (int c = 0; c < 3; ++c) places[c] = BitsOf(mesh.vertices_m[mesh.triangles[triangle][c]]);
  std::sort(places.begin(), places.end());
  return places;
}

// Which triangles have the corners, in any order, of an earlier one. Every triangle has a key, a sum of its
// corners' hashes, which does not depend on their order. A small table of bits, which stays in the cache,
// clears all triangles but those whose bit another one shares, one in ten; only these are compared in full.
std::vector<bool> FindRepeated(const TriangleMesh& mesh) {
  std::vector<uint64_t> vertex_hash(mesh.vertices_m.size());
  InPieces(vertex_hash.size(), [&](size_t begin, size_t end) {
    for (size_t v = begin; v < end; ++v) {
      const PositionBits bits = BitsOf(mesh.vertices_m[v]);
      vertex_hash[v] = Mix(Mix((uint64_t{bits[0]} << 32) | bits[1]) + bits[2] + 0x9E3779B97F4A7C15u);
    }
  });
  const size_t count = mesh.triangles.size();
  std::vector<uint64_t> keys(count);
  InPieces(count, [&](size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      const auto& corner = mesh.triangles[t];
      keys[t] = Mix(vertex_hash[corner[0]] + vertex_hash[corner[1]] + vertex_hash[corner[2]]);
    }
  });
  // By one core: all triangles share the tables of bits.
  KeyBits seen(count), shared(count);
  for (const uint64_t key : keys) {
    if (seen.Has(key)) shared.Set(key);
    seen.Set(key);
  }
  std::vector<bool> repeated(count);
  absl::flat_hash_set<std::array<PositionBits, 3>> places;
  for (uint32_t t = 0; t < count; ++t)
    if (shared.Has(keys[t])) repeated[t] = !places.insert(SortedPlaces(mesh, t)).second;
  return repeated;
}

bool HasNoArea(const TriangleMesh& mesh, uint32_t triangle) {
  return IsDegenerate(mesh.Corner(triangle, 0), mesh.Corner(triangle, 1), mesh.Corner(triangle, 2));
}

// Counts edges by how many triangles run along them and in which direction. Each directed edge is one number:
// lower vertex, higher vertex, direction; sorting puts the uses of one edge side by side.
void CountEdges(const TriangleMesh& mesh, MeshReport* report) {
  TOUCHSTONE_CHECK(mesh.vertices_m.size() < (uint64_t{1} << 31));
  const std::vector<uint32_t> place = FirstAtSamePlace(mesh.vertices_m);
  std::vector<uint64_t> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (const auto& corner : mesh.triangles) {
    const std::array<uint64_t, 3> at = {place[corner[0]], place[corner[1]], place[corner[2]]};
    if (at[0] == at[1] || at[1] == at[2] || at[2] == at[0]) continue;  // shrunk to a line: it bounds nothing
    for (int c = 0; c < 3; ++c) {
      const uint64_t from = at[c], to = at[(c + 1) % 3];
      edges.push_back((std::min(from, to) << 32) | (std::max(from, to) << 1) | (from < to ? 0 : 1));
    }
  }
  std::sort(edges.begin(), edges.end());
  for (size_t begin = 0, end; begin < edges.size(); begin = end) {
    end = begin + 1;
    while (end < edges.size() && (edges[end] >> 1) == (edges[begin] >> 1)) ++end;
    if (end - begin == 1) ++report->boundary_edges;
    if (end - begin > 2) ++report->nonmanifold_edges;
    if (end - begin == 2 && edges[begin] == edges[begin + 1]) ++report->inconsistent_edges;
  }
}

}  // namespace

std::vector<uint32_t> FirstAtSamePlace(const std::vector<Eigen::Vector3f>& vertices_m) {
  absl::flat_hash_map<PositionBits, uint32_t> first_at;
  first_at.reserve(vertices_m.size());
  std::vector<uint32_t> first(vertices_m.size());
  for (uint32_t v = 0; v < vertices_m.size(); ++v)
    first[v] = first_at.try_emplace(BitsOf(vertices_m[v]), v).first->second;
  return first;
}

bool IsDegenerate(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  return ((b - a).cross(c - a).array() == 0.0).all();
}

Bounds ComputeBounds(const TriangleMesh& mesh) {
  Eigen::Vector3f lower = Eigen::Vector3f::Constant(std::numeric_limits<float>::infinity());
  Eigen::Vector3f upper = -lower;
  for (const auto& corner : mesh.triangles) {
    for (int c = 0; c < 3; ++c) {
      lower = lower.cwiseMin(mesh.vertices_m[corner[c]]);
      upper = upper.cwiseMax(mesh.vertices_m[corner[c]]);
    }
  }
  Bounds bounds;
  if (mesh.triangles.empty()) return bounds;
  bounds.min_m = lower.cast<double>();
  bounds.max_m = upper.cast<double>();
  return bounds;
}

double DistanceToLeave(const Bounds& bounds, const Eigen::Vector3d& point_m,
                       const Eigen::Vector3d& direction) {
  double enters_m = 0, leaves_m = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double low_m = bounds.min_m[axis] - point_m[axis], high_m = bounds.max_m[axis] - point_m[axis];
    if (direction[axis] == 0) {
      if (low_m > 0 || high_m < 0) return 0;
      continue;
    }
    const double first_m = low_m / direction[axis], second_m = high_m / direction[axis];
    enters_m = std::max(enters_m, std::min(first_m, second_m));
    leaves_m = std::min(leaves_m, std::max(first_m, second_m));
  }
  return leaves_m >= enters_m && std::isfinite(leaves_m) ? leaves_m : 0;
}

MeshReport InspectMesh(const TriangleMesh& mesh) {
  MeshReport report;
  report.vertices = mesh.vertices_m.size();
  report.triangles = mesh.triangles.size();
  CountEdges(mesh, &report);

  const std::vector<bool> repeated = FindRepeated(mesh);
  report.duplicate_triangles = std::count(repeated.begin(), repeated.end(), true);
  std::vector<bool> used(mesh.vertices_m.size());
  // Signed volume: tetrahedra from the box's centre, so that a mesh far from the origin loses no digits.
  const Eigen::Vector3d centre =
      mesh.triangles.empty() ? Eigen::Vector3d::Zero() : ComputeBounds(mesh).Centre();
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (HasNoArea(mesh, t)) ++report.degenerate_triangles;
    const Eigen::Vector3d a = mesh.Corner(t, 0) - centre, b = mesh.Corner(t, 1) - centre,
                          c = mesh.Corner(t, 2) - centre;
    report.signed_volume_m3 += a.dot(b.cross(c)) / 6.0;
    for (int k = 0; k < 3; ++k) used[mesh.triangles[t][k]] = true;
  }
  report.unused_vertices = std::count(used.begin(), used.end(), false);
  return report;
}

TriangleMesh WithoutDegenerateAndDuplicate(TriangleMesh mesh) {
  const std::vector<bool> repeated = FindRepeated(mesh);
  std::vector<uint8_t> dropped(mesh.triangles.size());
  InPieces(dropped.size(), [&](size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) dropped[t] = repeated[t] || HasNoArea(mesh, t);
  });
  size_t kept = 0;
  for (size_t t = 0; t < dropped.size(); ++t)
    if (!dropped[t]) mesh.triangles[kept++] = mesh.triangles[t];
  mesh.triangles.resize(kept);
  return mesh;
}

std::string MeshHash(const TriangleMesh& mesh) {
  static_assert(sizeof(Eigen::Vector3f) == 12 && sizeof(std::array<uint32_t, 3>) == 12);
  const uint64_t counts[2] = {mesh.vertices_m.size(), mesh.triangles.size()};
  std::string bytes;
  bytes.reserve(sizeof counts + 12 * (counts[0] + counts[1]));
  bytes.append(reinterpret_cast<const char*>(counts), sizeof counts);
  bytes.append(reinterpret_cast<const char*>(mesh.vertices_m.data()), 12 * counts[0]);
  bytes.append(reinterpret_cast<const char*>(mesh.triangles.data()), 12 * counts[1]);
  return Sha256Hex(bytes);
}

}  // namespace touchstone::geometry
