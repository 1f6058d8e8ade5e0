// The definition of a contact, in double precision: where a line meets a triangle. Every path that casts
// (packets, the exact search, the tests) uses these expressions in this order, so that they agree bit for
// bit.
#pragma once

#include "server/geometry/lanes.h"

namespace touchstone {

template <typename Number>
struct LineTriangle {
  // Moments of the line about the edges opposite corners 0, 1, 2: proportional to the barycentric
  // coordinates. Their sum is `facing`. Exactly antisymmetric in an edge's ends, so two triangles with a
  // common edge leave no gap between them.
  Number moment[3];
  Triple<Number> area_vector;  // twice the area, along the counter-clockwise normal
  Number facing;               // area_vector . direction
  Number travel_m;             // to the triangle's plane; not finite if the line runs along it
};

// a, b, c: the corners relative to the line's origin.
template <typename Number>
LineTriangle<Number> MeetTriangle(const Triple<Number>& direction, const Triple<Number>& a,
                                  const Triple<Number>& b, const Triple<Number>& c) {
  LineTriangle<Number> meet;
  meet.moment[0] = Dot(direction, Cross(b, c));
  meet.moment[1] = Dot(direction, Cross(c, a));
  meet.moment[2] = Dot(direction, Cross(a, b));
  meet.area_vector = Cross(b - a, c - a);
  meet.facing = Dot(meet.area_vector, direction);
  meet.travel_m = Dot(meet.area_vector, a) / meet.facing;
  return meet;
}

// Inside or exactly on the border, whichever face is met.
inline bool MeetsInside(const LineTriangle<double>& meet) {
  const bool back = meet.moment[0] >= 0 && meet.moment[1] >= 0 && meet.moment[2] >= 0;
  const bool front = meet.moment[0] <= 0 && meet.moment[1] <= 0 && meet.moment[2] <= 0;
  return meet.facing != 0 && (front || back);
}

// The normal that contacts report: unit, against the direction.
template <typename Number>
Triple<Number> NormalAgainst(const LineTriangle<Number>& meet) {
  const Number length = SquareRoot(Dot(meet.area_vector, meet.area_vector));
  return meet.area_vector * ((meet.facing > 0 ? Number{} - 1.0 : Number{} + 1.0) / length);
}

}  // namespace touchstone
