// The definition of a contact, in double precision: where a line meets a triangle. Every path that casts (packets,
// the exact search, the tests) uses these expressions in this order, so that they agree bit for bit.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace touchstone {

struct LineTriangle {
  // Moments of the line about the edges opposite corners 0, 1, 2: proportional to the barycentric coordinates.
  // Exactly antisymmetric in an edge's ends, so two triangles with a common edge leave no gap between them.
  double moment[3];
  Eigen::Vector3d area_vector;  // twice the area, along the counter-clockwise normal
  double facing;                // area_vector . direction
  double travel_m;              // to the triangle's plane; not finite if the line runs along it

  // Inside or exactly on the border, whichever face is met.
  bool Inside() const {
    const bool front = moment[0] <= 0 && moment[1] <= 0 && moment[2] <= 0;
    const bool back = moment[0] >= 0 && moment[1] >= 0 && moment[2] >= 0;
    return facing != 0 && (front || back);
  }
};

// a, b, c: the corners relative to the line's origin.
inline LineTriangle MeetTriangle(const Eigen::Vector3d& direction, const Eigen::Vector3d& a,
                                 const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  LineTriangle meet;
  meet.moment[0] = direction.dot(b.cross(c));
  meet.moment[1] = direction.dot(c.cross(a));
  meet.moment[2] = direction.dot(a.cross(b));
  meet.area_vector = (b - a).cross(c - a);
  meet.facing = meet.area_vector.dot(direction);
  meet.travel_m = meet.area_vector.dot(a) / meet.facing;
  return meet;
}

// The normal that contacts report: unit, against the direction.
inline Eigen::Vector3d NormalAgainst(const LineTriangle& meet) {
  const double length = std::sqrt(meet.area_vector.squaredNorm());
  return meet.area_vector * ((meet.facing > 0 ? -1.0 : 1.0) / length);
}

}  // namespace touchstone
