// The definition of a contact, in double precision: where a line meets a triangle. Every path that casts
// (packets, the exact search, the tests) uses these expressions in this order, so that they agree bit for
// bit.
#pragma once

#include <algorithm>

#include "server/geometry/lanes.h"

namespace touchstone::geometry {

// The border counts this far beyond: more than double precision may be off within a kilometre, so that no
// line slips between triangles that meet in an edge or at a vertex.
inline constexpr double kBorderM = 1e-11;

template <typename Number>
struct LineTriangle {
  // Moments of the line about the edges opposite corners 0, 1, 2: over the edge's length at most the distance
  // between the line and the edge's line. They have the sign of `facing` where the line passes inside.
  Number moment[3];
  Triple<Number> edge[3];
  Triple<Number> area_vector;  // twice the area, along the counter-clockwise normal
  Number facing;               // area_vector . direction
  Number travel_m;             // to the triangle's plane; not finite if the line runs along it
};

// a, b, c: the corners relative to the line's origin.
template <typename Number>
[[gnu::always_inline]] inline LineTriangle<Number> IntersectTriangle(const Triple<Number>& direction,
                                                                     const Triple<Number>& a,
                                                                     const Triple<Number>& b,
                                                                     const Triple<Number>& c) {
  LineTriangle<Number> hit;
  hit.edge[0] = c - b;
  hit.edge[1] = a - c;
  hit.edge[2] = b - a;
  hit.moment[0] = Dot(direction, Cross(b, hit.edge[0]));
  hit.moment[1] = Dot(direction, Cross(c, hit.edge[1]));
  hit.moment[2] = Dot(direction, Cross(a, hit.edge[2]));
  hit.area_vector = Cross(hit.edge[1], hit.edge[2]);
  hit.facing = Dot(hit.area_vector, direction);
  hit.travel_m = Dot(hit.area_vector, a) / hit.facing;
  return hit;
}

// Inside or on the border, whichever face is met.
inline bool HitsInside(const LineTriangle<double>& hit, const Triple1& direction, const Triple1& a,
                       const Triple1& b, const Triple1& c) {
  // Seen edge-on, the plane says nothing: a line along a face does not touch it.
  constexpr double kMinCosine = 1e-8;
  if (!(hit.facing * hit.facing > kMinCosine * kMinCosine * Dot(hit.area_vector, hit.area_vector)))
    return false;
  const double side = hit.facing > 0 ? 1 : -1;
  const Triple1* const start[3] = {&b, &c, &a};
  for (int i = 0; i < 3; ++i) {
    const double moment = hit.moment[i] * side;
    if (moment >= 0) continue;
    // The moment is the distance times the edge's length seen along the line.
    const Triple1 seen = Cross(hit.edge[i], direction);
    const double border2 = kBorderM * kBorderM * Dot(seen, seen);
    const double rounding2 = 1e-30 * Dot(*start[i], *start[i]) * Dot(hit.edge[i], hit.edge[i]);
    if (moment * moment > std::max(border2, rounding2)) return false;
  }
  // Seen nearly edge-on, the tolerance reaches far along the plane: the travel must be that of some place on
  // the triangle.
  constexpr double kSlackM = 1e-7;
  const double at_a = Dot(direction, a), at_b = Dot(direction, b), at_c = Dot(direction, c);
  return hit.travel_m >= std::min(at_a, std::min(at_b, at_c)) - kSlackM &&
         hit.travel_m <= std::max(at_a, std::max(at_b, at_c)) + kSlackM;
}

// The normal that contacts report: unit, against the direction.
template <typename Number>
Triple<Number> NormalAgainst(const LineTriangle<Number>& hit) {
  const Number length = SquareRoot(Dot(hit.area_vector, hit.area_vector));
  return hit.area_vector * ((hit.facing > 0 ? Number{} - 1.0 : Number{} + 1.0) / length);
}

}  // namespace touchstone::geometry
