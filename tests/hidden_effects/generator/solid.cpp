#include "tests/hidden_effects/generator/solid.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "server/geometry/files/mesh_file.h"
#include "server/geometry/shapes/supershape.h"

namespace touchstone::hidden {
namespace {

using Vec = Eigen::Vector3d;

constexpr uint32_t kLeafTriangles = 4;

Triangles FromMesh(const geometry::TriangleMesh& mesh) {
  Triangles out;
  for (const auto& vertex : mesh.vertices_m) out.vertices_mm.push_back(vertex.cast<double>() * 1000);
  out.corners = mesh.triangles;
  return out;
}

// Smallest t with |centre + t direction - point| = radius while approaching; NaN without one.
double TimeToPoint(const Vec& centre, const Vec& direction, const Vec& point, double radius) {
  const Vec away = centre - point;
  const double b = away.dot(direction);
  const double inside = b * b - (away.squaredNorm() - radius * radius);
  return inside < 0 ? NAN : -b - std::sqrt(inside);
}

// The same for the segment p q without its ends; `*nearest` is then the point of the segment.
double TimeToEdge(const Vec& centre, const Vec& direction, const Vec& p, const Vec& q, double radius,
                  Vec* nearest) {
  const Vec along = q - p;
  const double length2 = along.squaredNorm();
  if (length2 == 0) return NAN;
  // Everything square to the edge.
  const Vec away = centre - p;
  const Vec away_square = away - along * (away.dot(along) / length2);
  const Vec direction_square = direction - along * (direction.dot(along) / length2);
  const double a = direction_square.squaredNorm();
  if (a < 1e-24) return NAN;  // moves along the edge: an end is first
  const double b = away_square.dot(direction_square), c = away_square.squaredNorm() - radius * radius;
  const double inside = b * b - a * c;
  if (inside < 0) return NAN;
  const double t = (-b - std::sqrt(inside)) / a;
  const double s = (away + t * direction).dot(along) / length2;
  if (s < 0 || s > 1) return NAN;
  *nearest = p + s * along;
  return t;
}

}  // namespace

Triangles ReadTriangles(const std::string& off_path) {
  auto mesh = geometry::ReadMeshFile(off_path);
  if (!mesh.ok()) throw std::runtime_error(std::string(mesh.status().message()));
  return FromMesh(*mesh);
}

Triangles SupershapeTriangles(const std::string& name, uint64_t triangles) {
  auto parameters = geometry::NamedSupershape(name);
  if (!parameters.ok()) throw std::runtime_error(std::string(parameters.status().message()));
  return FromMesh(geometry::MakeSupershape(*parameters, triangles).value());
}

Solid::Solid(std::string name, Triangles triangles)
    : name_(std::move(name)), triangles_(std::move(triangles)), order_(triangles_.corners.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  boxes_.reserve(2 * order_.size());
  Build(0, order_.size());
}

uint32_t Solid::Build(uint32_t begin, uint32_t end) {
  const uint32_t self = boxes_.size();
  boxes_.emplace_back();
  Box box;
  Vec low = Vec::Constant(1e300), high = Vec::Constant(-1e300);  // of the centroids
  const auto centroid = [&](uint32_t t) -> Vec {
    const auto& c = triangles_.corners[t];
    return (triangles_.vertices_mm[c[0]] + triangles_.vertices_mm[c[1]] + triangles_.vertices_mm[c[2]]) / 3;
  };
  for (uint32_t k = begin; k < end; ++k) {
    for (const uint32_t corner : triangles_.corners[order_[k]]) {
      box.low = box.low.cwiseMin(triangles_.vertices_mm[corner]);
      box.high = box.high.cwiseMax(triangles_.vertices_mm[corner]);
    }
    low = low.cwiseMin(centroid(order_[k]));
    high = high.cwiseMax(centroid(order_[k]));
  }
  if (end - begin <= kLeafTriangles) {
    box.begin = begin, box.end = end;
  } else {
    int axis = 0;
    (high - low).maxCoeff(&axis);
    const uint32_t middle = begin + (end - begin) / 2;
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](uint32_t a, uint32_t b) { return centroid(a)[axis] < centroid(b)[axis]; });
    box.left = Build(begin, middle);
    box.right = Build(middle, end);
  }
  boxes_[self] = box;
  return self;
}

void Solid::TryTriangle(uint32_t triangle, const Vec& centre, const Vec& direction, double radius,
                        Contact* best) const {
  const auto& corner = triangles_.corners[triangle];
  const Vec p[3] = {triangles_.vertices_mm[corner[0]], triangles_.vertices_mm[corner[1]],
                    triangles_.vertices_mm[corner[2]]};
  const auto take = [&](double t, const Vec& point, const Vec& outward) {
    if (!(t >= 0) || (best->hit && t >= best->travel_mm)) return;
    *best = {t, point, outward, true};
  };

  // The face, moved out by the radius towards where the sphere comes from.
  Vec normal = (p[1] - p[0]).cross(p[2] - p[0]);
  const double twice_area = normal.norm();
  if (twice_area > 0) {
    normal /= twice_area;
    if (normal.dot(direction) > 0) normal = -normal;
    const double towards = -normal.dot(direction);
    if (towards > 0) {
      const double t = (normal.dot(centre - p[0]) - radius) / towards;
      const Vec point = centre + t * direction - radius * normal;
      // Inside if the point is on the same side of all three edges.
      double min_side = 1e300, max_side = -1e300;
      for (int k = 0; k < 3; ++k) {
        const double side = (p[(k + 1) % 3] - p[k]).cross(point - p[k]).dot(normal);
        min_side = std::min(min_side, side), max_side = std::max(max_side, side);
      }
      const double slack = 1e-12 * twice_area;
      if (min_side >= -slack || max_side <= slack) take(t, point, normal);
    }
  }
  if (radius <= 0) return;
  for (int k = 0; k < 3; ++k) {
    Vec nearest;
    const double t = TimeToEdge(centre, direction, p[k], p[(k + 1) % 3], radius, &nearest);
    if (t == t) take(t, nearest, (centre + t * direction - nearest) / radius);
    const double at_corner = TimeToPoint(centre, direction, p[k], radius);
    if (at_corner == at_corner) take(at_corner, p[k], (centre + at_corner * direction - p[k]) / radius);
  }
}

Contact Solid::FirstContact(const Vec& origin, const Vec& direction, double radius) const {
  const Vec centre = origin - radius * direction;
  Contact best;
  uint32_t stack[128];
  int depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const Box& box = boxes_[stack[--depth]];
    // The line against the box inflated by the radius.
    double from = 0, until = best.hit ? best.travel_mm : 1e300;
    for (int axis = 0; axis < 3 && from <= until; ++axis) {
      const double low = box.low[axis] - radius - 1e-9, high = box.high[axis] + radius + 1e-9;
      if (direction[axis] == 0) {
        if (centre[axis] < low || centre[axis] > high) until = -1;
        continue;
      }
      const double a = (low - centre[axis]) / direction[axis], b = (high - centre[axis]) / direction[axis];
      from = std::max(from, std::min(a, b)), until = std::min(until, std::max(a, b));
    }
    if (from > until) continue;
    if (box.right != 0) {
      stack[depth++] = box.left, stack[depth++] = box.right;
    } else {
      for (uint32_t k = box.begin; k < box.end; ++k) TryTriangle(order_[k], centre, direction, radius, &best);
    }
  }
  return best;
}

Contact Solid::FirstContactOfAll(const Vec& origin, const Vec& direction, double radius) const {
  Contact best;
  for (uint32_t k = 0; k < order_.size(); ++k)
    TryTriangle(k, origin - radius * direction, direction, radius, &best);
  return best;
}

}  // namespace touchstone::hidden
