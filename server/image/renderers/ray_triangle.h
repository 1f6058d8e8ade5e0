// Where a ray meets a triangle's plane, for one ray (Number: float) or for many at a time (vectors of GCC). Everything has
// internal linkage and is inlined, so that files for different processors keep their own. Part of the CPU renderer only.
#pragma once

namespace touchstone::image {
namespace {

template <typename Number>
struct Triple {
  Number x, y, z;
};

template <typename Number>
[[gnu::always_inline]] inline Number Dot(const Triple<Number>& a, const Triple<Number>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <typename Number>
struct TriangleHit {
  Number u, v, w;         // weights of the second, the third and the first corner; within the triangle
  Number determinant;     // negative: the ray meets the back
  Triple<Number> e1, e2;  // from the first corner to the second and the third
  Triple<Number> point;
};

// The ray origin + t * direction (Moeller and Trumbore 1997), kept inside the triangle where rounding leads out of it.
template <typename Number>
[[gnu::always_inline]] inline TriangleHit<Number> MeetTriangle(const Triple<Number>& origin,
                                                               const Triple<Number>& direction,
                                                               const Triple<Number>& a,
                                                               const Triple<Number>& b,
                                                               const Triple<Number>& c) {
  const Number zero = Number{}, one = Number{} + 1.0f;
  TriangleHit<Number> hit;
  const Triple<Number> e1 = {b.x - a.x, b.y - a.y, b.z - a.z};
  const Triple<Number> e2 = {c.x - a.x, c.y - a.y, c.z - a.z};
  const Triple<Number>& d = direction;
  const Triple<Number> p = {d.y * e2.z - d.z * e2.y, d.z * e2.x - d.x * e2.z, d.x * e2.y - d.y * e2.x};
  const Number determinant = Dot(e1, p);
  const Number inverse = 1.0f / (determinant == 0.0f ? Number{} + 1e-30f : determinant);
  const Triple<Number> s = {origin.x - a.x, origin.y - a.y, origin.z - a.z};
  const Triple<Number> q = {s.y * e1.z - s.z * e1.y, s.z * e1.x - s.x * e1.z, s.x * e1.y - s.y * e1.x};
  const Number free_u = Dot(s, p) * inverse, free_v = Dot(d, q) * inverse;
  const Number low_u = free_u > zero ? free_u : zero, low_v = free_v > zero ? free_v : zero;
  const Number u = low_u < one ? low_u : one;
  const Number rest = 1.0f - u;
  const Number v = low_v < rest ? low_v : rest;
  hit.u = u, hit.v = v, hit.w = 1.0f - u - v;
  hit.determinant = determinant;
  hit.e1 = e1, hit.e2 = e2;
  hit.point = {a.x + u * e1.x + v * e2.x, a.y + u * e1.y + v * e2.y, a.z + u * e1.z + v * e2.z};
  return hit;
}

}  // namespace
}  // namespace touchstone::image
