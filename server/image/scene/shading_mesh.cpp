#include "server/image/scene/shading_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>

#include "server/base/numbers/random.h"
#include "server/image/scene/shading.h"

namespace touchstone::image {
namespace {

constexpr uint32_t kNone = 0xFFFFFFFFu;

// For each vertex the first one with bit-equal coordinates (-0 counts as 0).
std::vector<uint32_t> WeldVertices(const geometry::TriangleMesh& mesh) {
  struct Key {
    std::array<uint32_t, 3> bits;
    uint32_t vertex;
    bool operator<(const Key& other) const {
      return bits != other.bits ? bits < other.bits : vertex < other.vertex;
    }
  };
  std::vector<Key> keys(mesh.vertices_m.size());
  for (uint32_t v = 0; v < keys.size(); ++v) {
    keys[v].vertex = v;
    for (int axis = 0; axis < 3; ++axis) {
      const float value = mesh.vertices_m[v][axis] + 0.0f;
      std::memcpy(&keys[v].bits[axis], &value, sizeof value);
    }
  }
  std::sort(keys.begin(), keys.end());
  std::vector<uint32_t> welded(keys.size());
  for (size_t i = 0; i < keys.size(); ++i) {
    const bool same = i > 0 && keys[i].bits == keys[i - 1].bits;
    welded[keys[i].vertex] = same ? welded[keys[i - 1].vertex] : keys[i].vertex;
  }
  return welded;
}

// Corners (3 * triangle + place) in groups that share a normal.
class CornerGroups {
 public:
  explicit CornerGroups(size_t corners) : parent_(corners) { std::iota(parent_.begin(), parent_.end(), 0u); }
  uint32_t Root(uint32_t corner) {
    while (parent_[corner] != corner) corner = parent_[corner] = parent_[parent_[corner]];
    return corner;
  }
  // The smaller corner becomes the root: the result does not depend on the order of joining.
  void Join(uint32_t a, uint32_t b) {
    a = Root(a), b = Root(b);
    if (a != b) parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<uint32_t> parent_;
};

// One of a triangle's edges, from corner `first` to the next; sorts edges of the same two vertices together.
struct HalfEdge {
  uint32_t low, high;  // welded vertices
  uint32_t first;      // corner
  bool forward;        // runs from low to high
  bool operator<(const HalfEdge& other) const {
    if (low != other.low) return low < other.low;
    if (high != other.high) return high < other.high;
    return first < other.first;
  }
};

uint32_t NextCorner(uint32_t corner) {
  return corner % 3 == 2 ? corner - 2 : corner + 1;
}

// Every half edge of the mesh, those of the same two vertices side by side.
std::vector<HalfEdge> SortedHalfEdges(const geometry::TriangleMesh& mesh,
                                      const std::vector<uint32_t>& welded) {
  std::vector<HalfEdge> edges(3 * mesh.triangles.size());
  for (uint32_t corner = 0; corner < edges.size(); ++corner) {
    const uint32_t next = NextCorner(corner);
    const uint32_t from = welded[mesh.triangles[corner / 3][corner % 3]];
    const uint32_t to = welded[mesh.triangles[next / 3][next % 3]];
    edges[corner] = {std::min(from, to), std::max(from, to), corner, from < to};
  }
  std::sort(edges.begin(), edges.end());
  return edges;
}

// Joins the corners on both sides of every edge that is no crease. Returns whether the mesh is closed and consistently
// wound: whether every edge has two triangles that run through it in opposite directions.
bool JoinSmoothEdges(const std::vector<HalfEdge>& edges, const std::vector<Eigen::Vector3d>& normals,
                     CornerGroups* groups) {
  bool closed = true;
  const double crease_cosine = std::cos(kCreaseRad);
  for (size_t i = 0; i < edges.size();) {
    size_t end = i + 1;
    while (end < edges.size() && edges[end].low == edges[i].low && edges[end].high == edges[i].high) ++end;
    if (end - i == 2 && edges[i].forward != edges[i + 1].forward) {
      const uint32_t a = edges[i].first, b = edges[i + 1].first;
      const Eigen::Vector3d &na = normals[a / 3], &nb = normals[b / 3];
      if (na.dot(nb) > crease_cosine * na.norm() * nb.norm()) {
        groups->Join(a, NextCorner(b));
        groups->Join(NextCorner(a), b);
      }
    } else {
      closed = false;
    }
    i = end;
  }
  return closed;
}

// Whether any ray from outside meets a back face first: inverted parts, walls that cross each other. Rays
// between random points of the bounding sphere and of the sphere inside it; the same ones for every mesh.
bool ShowsBackFaces(const geometry::Surface& surface, double sign) {
  constexpr int kProbes = 8192;
  const double radius_m = 0.5 * surface.bounds().DiagonalM();
  const Eigen::Vector3d centre_m = surface.bounds().Centre();
  RandomStream random(0, RandomDomain::kImage);
  std::vector<Eigen::Vector3d> origins_m(kProbes), directions(kProbes);
  for (int i = 0; i < kProbes; ++i) {
    const Eigen::Vector3d start(random.Normal(), random.Normal(), random.Normal());
    const Eigen::Vector3d end(random.Uniform(-0.6, 0.6), random.Uniform(-0.6, 0.6),
                              random.Uniform(-0.6, 0.6));
    origins_m[i] = centre_m + 1.01 * radius_m * start.normalized();
    directions[i] = (centre_m + radius_m * end - origins_m[i]).normalized();
  }
  geometry::Contacts contacts;
  surface.CastLines(origins_m, directions, 4 * radius_m, &contacts);
  const geometry::TriangleMesh& mesh = surface.mesh();
  for (int i = 0; i < kProbes; ++i) {
    const uint32_t triangle = contacts.triangle[i];
    if (triangle == geometry::kNoTriangle) continue;
    const Eigen::Vector3d a = mesh.Corner(triangle, 0);
    const Eigen::Vector3d normal =
        sign * (mesh.Corner(triangle, 1) - a).cross(mesh.Corner(triangle, 2) - a).normalized();
    if (normal.dot(directions[i]) > 1e-3) return true;
  }
  return false;
}

}  // namespace

ShadingMesh MakeShadingMesh(const geometry::Surface& surface) {
  const geometry::TriangleMesh& mesh = surface.mesh();
  const size_t triangles = mesh.triangles.size();
  const std::vector<uint32_t> welded = WeldVertices(mesh);

  // Normals with the length of twice the triangle's area; the volume tells whether the mesh is inside out.
  std::vector<Eigen::Vector3d> normals(triangles);
  double volume = 0;
  const Eigen::Vector3d centre_m = surface.bounds().Centre();
  for (uint32_t t = 0; t < triangles; ++t) {
    const Eigen::Vector3d a = mesh.Corner(t, 0), b = mesh.Corner(t, 1), c = mesh.Corner(t, 2);
    normals[t] = (b - a).cross(c - a);
    volume += (a - centre_m).dot(normals[t]);
  }

  CornerGroups groups(3 * triangles);
  const bool closed = JoinSmoothEdges(SortedHalfEdges(mesh, welded), normals, &groups);

  // Area-weighted sums over the groups.
  std::vector<uint32_t> vertex_of_root(3 * triangles, kNone);
  std::vector<Eigen::Vector3d> sums;
  ShadingMesh result;
  result.corners.resize(3 * triangles);
  for (uint32_t corner = 0; corner < 3 * triangles; ++corner) {
    const uint32_t root = groups.Root(corner);
    if (vertex_of_root[root] == kNone) {
      vertex_of_root[root] = static_cast<uint32_t>(sums.size());
      sums.push_back(Eigen::Vector3d::Zero());
      const Eigen::Vector3f& p = mesh.vertices_m[mesh.triangles[corner / 3][corner % 3]];
      result.vertices.push_back({{p.x(), p.y(), p.z()}, {0, 0, 0}});
    }
    result.corners[corner] = vertex_of_root[root];
    sums[vertex_of_root[root]] += normals[corner / 3];
  }

  const double sign = closed && volume < 0 ? -1.0 : 1.0;
  result.outward = closed && !ShowsBackFaces(surface, sign);
  for (uint32_t corner = 0; corner < 3 * triangles; ++corner) {
    Eigen::Vector3d& sum = sums[result.corners[corner]];
    if (sum.squaredNorm() < 1e-300) sum = normals[corner / 3];  // opposite faces cancel: any one will do
  }
  for (size_t v = 0; v < sums.size(); ++v) {
    const Eigen::Vector3d normal = sign * sums[v].normalized();
    for (int axis = 0; axis < 3; ++axis) result.vertices[v].normal[axis] = static_cast<float>(normal[axis]);
  }
  if (sign < 0)
    for (uint32_t t = 0; t < triangles; ++t) std::swap(result.corners[3 * t + 1], result.corners[3 * t + 2]);
  result.vertices.shrink_to_fit();
  return result;
}

std::shared_ptr<const ShadingMesh> ShadingMeshCache::Get(
    const std::shared_ptr<const geometry::Surface>& surface) {
  std::promise<std::shared_ptr<const ShadingMesh>> promise;
  std::shared_future<std::shared_ptr<const ShadingMesh>> mesh;
  bool compute = false;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    auto found = entries_.find(surface.get());
    // A new surface may have the address of one that was destroyed.
    if (found != entries_.end() && found->second.surface.lock() != surface) {
      entries_.erase(found);
      found = entries_.end();
    }
    if (found == entries_.end()) {
      compute = true;
      found = entries_.emplace(surface.get(), Entry{surface, promise.get_future().share(), 0, 0}).first;
    }
    found->second.last_use = ++uses_;
    mesh = found->second.mesh;
    DropSome(surface.get());
  }
  if (!compute) return mesh.get();

  // Callers who ask for the same surface meanwhile wait; those who ask for another do not.
  promise.set_value(std::make_shared<const ShadingMesh>(MakeShadingMesh(*surface)));
  std::lock_guard<std::mutex> lock(mutex_);
  const auto found = entries_.find(surface.get());
  if (found != entries_.end()) found->second.bytes = mesh.get()->MemoryBytes();
  DropSome(surface.get());
  return mesh.get();
}

size_t ShadingMeshCache::size() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return entries_.size();
}

void ShadingMeshCache::DropSome(const geometry::Surface* newest) {
  uint64_t bytes = 0;
  for (auto entry = entries_.begin(); entry != entries_.end();) {
    if (entry->second.surface.expired()) {
      entry = entries_.erase(entry);
    } else {
      bytes += entry->second.bytes;
      ++entry;
    }
  }
  while (entries_.size() > 1 && (entries_.size() > kMaxEntries || bytes > kMaxBytes)) {
    auto oldest = entries_.end();
    for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
      if (entry->first == newest) continue;
      if (oldest == entries_.end() || entry->second.last_use < oldest->second.last_use) oldest = entry;
    }
    bytes -= oldest->second.bytes;
    entries_.erase(oldest);
  }
}

}  // namespace touchstone::image
