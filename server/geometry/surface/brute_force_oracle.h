// Contacts found the slow and plain way, for tests only: every triangle, double precision, nothing shared
// with what is tested but the mesh.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <vector>

#include "server/geometry/mesh/mesh.h"

namespace touchstone::geometry {

using Eigen::Vector3d;

// Ericson's IntersectSegmentTriangle ("Real-Time Collision Detection", section 5.3.6), for both faces: the
// travel along p -> q, or infinity.
inline double SegmentTravel(const Vector3d& p, const Vector3d& q, const Vector3d& a, Vector3d b, Vector3d c) {
  const Vector3d qp = p - q;
  Vector3d n = (b - a).cross(c - a);
  if (qp.dot(n) < 0) {
    std::swap(b, c);
    n = -n;
  }
  const double none = std::numeric_limits<double>::infinity();
  const double d = qp.dot(n);
  if (d <= 0) return none;
  const Vector3d ap = p - a;
  const double t = ap.dot(n);
  if (t < 0 || t > d) return none;
  const Vector3d e = qp.cross(ap);
  const double v = (c - a).dot(e), w = -(b - a).dot(e);
  if (v < 0 || v > d || w < 0 || v + w > d) return none;
  return t / d * qp.norm();
}

inline double BruteForceLine(const TriangleMesh& mesh, const Vector3d& origin, const Vector3d& direction,
                             double longest_m) {
  double best = std::numeric_limits<double>::infinity();
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t)
    best = std::min(best, SegmentTravel(origin, origin + longest_m * direction, mesh.Corner(t, 0),
                                        mesh.Corner(t, 1), mesh.Corner(t, 2)));
  return best;
}

inline double DistanceToSegment(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const double s = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
  return (p - a - s * (b - a)).norm();
}

// The plane's distance above the inside, else the nearest edge's.
inline double DistanceToTriangle(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d n = (b - a).cross(c - a).normalized();
  const bool inside = n.dot((b - a).cross(p - a)) >= 0 && n.dot((c - b).cross(p - b)) >= 0 &&
                      n.dot((a - c).cross(p - c)) >= 0;
  if (inside) return std::fabs(n.dot(p - a));
  return std::min({DistanceToSegment(p, a, b), DistanceToSegment(p, b, c), DistanceToSegment(p, c, a)});
}

// The first t in [0, longest] at which centre + t * direction is within radius of the triangle, or infinity.
// The distance to a convex set is a convex function of t: its least value by golden section, then the
// crossing before it by bisection.
inline double BruteForceBall(const TriangleMesh& mesh, uint32_t triangle, const Vector3d& centre,
                             const Vector3d& direction, double radius, double longest) {
  const Vector3d a = mesh.Corner(triangle, 0), b = mesh.Corner(triangle, 1), c = mesh.Corner(triangle, 2);
  const auto gap = [&](double t) { return DistanceToTriangle(centre + t * direction, a, b, c) - radius; };
  if (gap(0) <= 0) return 0;
  const double golden = 0.6180339887498949;
  double from = 0, to = longest;
  for (int i = 0; i < 80 && to - from > 1e-13; ++i) {
    const double left = to - golden * (to - from), right = from + golden * (to - from);
    (gap(left) < gap(right) ? to : from) = gap(left) < gap(right) ? right : left;
  }
  double after = 0.5 * (from + to), before = 0;
  if (gap(after) > 0) return std::numeric_limits<double>::infinity();
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (before + after);
    (gap(middle) > 0 ? before : after) = middle;
  }
  return after;
}

inline double BruteForceBall(const TriangleMesh& mesh, const Vector3d& centre, const Vector3d& direction,
                             double radius, double longest) {
  double best = std::numeric_limits<double>::infinity();
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    // Triangles that stay outside a sphere round them, inflated by the radius, are not worth a search.
    const Vector3d a = mesh.Corner(t, 0);
    const double size =
        std::max((mesh.Corner(t, 1) - a).norm(), (mesh.Corner(t, 2) - a).norm()) + radius + 1e-6;
    if ((a - centre).cross(direction).norm() > size || (a - centre).dot(direction) - size > best) continue;
    best = std::min(best, BruteForceBall(mesh, t, centre, direction, radius, std::min(longest, best)));
  }
  return best;
}

// --- Meshes ---

inline TriangleMesh Soup(int triangles, double size, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(-0.05f, 0.05f), shift(-size, size);
  TriangleMesh mesh;
  for (int t = 0; t < triangles; ++t) {
    const Eigen::Vector3f at(place(random), place(random), place(random));
    for (int c = 0; c < 3; ++c)
      mesh.vertices_m.push_back(at + Eigen::Vector3f(shift(random), shift(random), shift(random)));
    const uint32_t first = 3 * t;
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

inline void AddBox(const Eigen::Vector3f& low, const Eigen::Vector3f& high, TriangleMesh* mesh) {
  const uint32_t base = static_cast<uint32_t>(mesh->vertices_m.size());
  for (int i = 0; i < 8; ++i)
    mesh->vertices_m.emplace_back(i & 1 ? high.x() : low.x(), i & 2 ? high.y() : low.y(),
                                  i & 4 ? high.z() : low.z());
  const uint32_t faces[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                                 {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  for (const auto& f : faces) mesh->triangles.push_back({base + f[0], base + f[1], base + f[2]});
}

inline TriangleMesh Box(const Eigen::Vector3f& low, const Eigen::Vector3f& high) {
  TriangleMesh mesh;
  AddBox(low, high, &mesh);
  return mesh;
}

// Two boxes that share a coplanar stretch and cross, a thin plate, and a step: all that is awkward at once.
inline TriangleMesh Awkward() {
  TriangleMesh mesh = Box({-0.05f, -0.05f, -0.05f}, {0.05f, 0.05f, 0.0f});
  AddBox({-0.02f, -0.05f, -0.03f}, {0.03f, 0.02f, 0.03f}, &mesh);   // crosses, one side coplanar
  AddBox({-0.05f, 0.0f, -0.02f}, {0.0f, 0.05f, 0.0f}, &mesh);       // inside, top coplanar with the first's
  AddBox({-0.04f, -0.04f, 0.04f}, {0.04f, 0.04f, 0.0401f}, &mesh);  // plate of 0.1 mm
  return mesh;
}

// A sphere of unit directions, subdivided from an octahedron.
inline TriangleMesh Sphere(double radius_m, int divisions) {
  TriangleMesh mesh;
  const Eigen::Vector3d poles[6] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  const int faces[8][3] = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                           {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  std::map<std::array<int, 3>, uint32_t> known;
  for (const auto& f : faces) {
    const auto vertex = [&](int i, int j) {
      const Vector3d sum = poles[f[0]] * (divisions - i - j) + poles[f[1]] * i + poles[f[2]] * j;
      const std::array<int, 3> key = {static_cast<int>(sum.x()), static_cast<int>(sum.y()),
                                      static_cast<int>(sum.z())};
      const auto [found, fresh] = known.try_emplace(key, static_cast<uint32_t>(mesh.vertices_m.size()));
      if (fresh) mesh.vertices_m.push_back((radius_m * sum.normalized()).cast<float>());
      return found->second;
    };
    for (int i = 0; i < divisions; ++i) {
      for (int j = 0; i + j < divisions; ++j) {
        mesh.triangles.push_back({vertex(i, j), vertex(i + 1, j), vertex(i, j + 1)});
        if (i + j + 1 < divisions)
          mesh.triangles.push_back({vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)});
      }
    }
  }
  return mesh;
}

// --- Lines ---

struct Lines {
  std::vector<Vector3d> origins_m, directions;
  void Add(const Vector3d& through, const Vector3d& direction, double before_m) {
    const Vector3d unit = direction.normalized();
    origins_m.push_back(through - before_m * unit);
    directions.push_back(unit);
  }
};

// Lines through points of the mesh: inside triangles, on edges and at vertices, there exactly or off by as
// little as 1e-10 m and as much as 1e-5 m, from all sides; so edges and vertices stand for silhouettes as
// often as not.
inline Lines AimedLines(const TriangleMesh& mesh, int count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::normal_distribution<double> normal;
  Lines lines;
  for (int i = 0; i < count; ++i) {
    const uint32_t triangle = static_cast<uint32_t>(random() % mesh.triangles.size());
    double u = uniform(random), v = uniform(random) * (1 - u);
    const int kind = i % 4;  // 0 inside, 1 edge, 2 vertex, 3 axis-parallel at a vertex or edge
    if (kind == 1 || (kind == 3 && i % 8 == 3)) v = 0;
    if (kind == 2 || (kind == 3 && i % 8 == 7)) u = v = 0;
    Vector3d at =
        mesh.Corner(triangle, 0) * (1 - u - v) + mesh.Corner(triangle, 1) * u + mesh.Corner(triangle, 2) * v;
    if (i % 3 != 0)
      at +=
          Vector3d(normal(random), normal(random), normal(random)) * std::pow(10, -10 + 5 * uniform(random));
    Vector3d direction(normal(random), normal(random), normal(random));
    if (kind == 3) direction = Vector3d::Unit(static_cast<int>(random() % 3)) * (random() % 2 ? 1 : -1);
    lines.Add(at, direction, 0.2 + 0.3 * uniform(random));
  }
  return lines;
}

}  // namespace touchstone::geometry
