#include "server/geometry/surface/swept_triangle.h"

#include <cmath>

namespace touchstone::geometry {

using Eigen::Vector3d;

Vector3d NearestPointOfTriangle(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d ab = b - a, ac = c - a;
  const double d1 = -ab.dot(a), d2 = -ac.dot(a);
  if (d1 <= 0 && d2 <= 0) return a;
  const double d3 = -ab.dot(b), d4 = -ac.dot(b);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  const double d5 = -ab.dot(c), d6 = -ac.dot(c);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  const double scale = 1.0 / (va + vb + vc);
  return a + ab * (vb * scale) + ac * (vc * scale);
}

bool SweepTriangle(const Vector3d& direction, double radius, const Vector3d& a, const Vector3d& b,
                   const Vector3d& c, double max_t, double* t, Vector3d* touch) {
  // Face: the centre comes within the radius of the plane, above the inside of the triangle. The edges are
  // not reached before that.
  Vector3d normal = (b - a).cross(c - a);
  normal /= std::sqrt(normal.squaredNorm());
  double height = normal.dot(a);  // of the plane, along the normal that points away from the start
  if (height < 0) {
    height = -height;
    normal = -normal;
  }
  const double approach = normal.dot(direction);
  if (height > radius) {
    if (approach <= 0) return false;
    const double at = (height - radius) / approach;
    if (at > max_t) return false;
    const Vector3d centre = at * direction;
    const Vector3d foot = centre + radius * normal;
    const Vector3d pa = a - foot, pb = b - foot, pc = c - foot;
    const double side0 = normal.dot(pa.cross(pb)), side1 = normal.dot(pb.cross(pc)),
                 side2 = normal.dot(pc.cross(pa));
    if ((side0 >= 0 && side1 >= 0 && side2 >= 0) || (side0 <= 0 && side1 <= 0 && side2 <= 0)) {
      *t = at;
      *touch = foot;
      return true;
    }
  } else {
    const Vector3d nearest = NearestPointOfTriangle(a, b, c);
    if (nearest.squaredNorm() <= radius * radius) {
      *t = 0;
      *touch = nearest;
      return true;
    }
  }

  bool found = false;
  double best = max_t;
  const Vector3d* const corners[3] = {&a, &b, &c};
  for (int i = 0; i < 3; ++i) {
    const Vector3d &p = *corners[i], &q = *corners[(i + 1) % 3];
    // Corner: the sine of the angle gives the distance at which the line passes it.
    const double miss2 = p.cross(direction).squaredNorm();
    const double left = radius * radius - miss2;
    if (left >= 0) {
      const double at = p.dot(direction) - std::sqrt(left);
      if (at >= 0 && at <= best) {
        best = at;
        *touch = p;
        found = true;
      }
    }
    // Edge: the same in the plane perpendicular to it.
    const Vector3d edge = q - p;
    const double length = std::sqrt(edge.squaredNorm());
    const Vector3d along = edge / length;
    const double direction_along = direction.dot(along), p_along = p.dot(along);
    const Vector3d direction_across = direction - direction_along * along;
    const Vector3d p_across = p - p_along * along;
    const double across2 = direction_across.squaredNorm();
    if (!(across2 > 0)) continue;
    const double turn = along.dot(p.cross(direction));  // = along . (p_across x direction_across)
    const double inside = across2 * radius * radius - turn * turn;
    if (!(inside >= 0)) continue;
    const double at = (p_across.dot(direction_across) - std::sqrt(inside)) / across2;
    const double spot = at * direction_along - p_along;
    if (at >= 0 && at <= best && spot >= 0 && spot <= length) {
      best = at;
      *touch = p + spot * along;
      found = true;
    }
  }
  *t = best;
  return found;
}

}  // namespace touchstone::geometry
