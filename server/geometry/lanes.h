// Numbers that are computed with together (GCC and Clang vector extensions): AVX registers where there are
// any, narrower ones elsewhere. And three-vectors of such numbers, or of plain ones, whose products have one
// fixed order of operations: a lane and a plain number give the same bits.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include <Eigen/Core>

#ifdef __AVX__
#include <immintrin.h>
#endif

namespace touchstone::geometry {

typedef float Float8 __attribute__((vector_size(32)));
typedef int32_t Mask8 __attribute__((vector_size(32)));  // -1 or 0 per lane, from comparisons
typedef double Double4 __attribute__((vector_size(32)));
typedef int64_t Mask4 __attribute__((vector_size(32)));

template <typename Lanes>
Lanes LoadLanes(const void* from) {
  Lanes lanes;
  std::memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}
template <typename Lanes>
void StoreLanes(void* to, Lanes lanes) {
  std::memcpy(to, &lanes, sizeof(lanes));
}

template <typename Mask, typename Lanes>
Lanes Select(Mask mask, Lanes if_true, Lanes if_false) {
  return mask ? if_true : if_false;
}
template <typename Lanes>
Lanes MaxLanes(Lanes a, Lanes b) {
  return a > b ? a : b;
}
template <typename Lanes>
Lanes MinLanes(Lanes a, Lanes b) {
  return a < b ? a : b;
}

// One bit per lane.
inline uint32_t BitsOf(Mask8 mask) {
#ifdef __AVX__
  return static_cast<uint32_t>(_mm256_movemask_ps(reinterpret_cast<__m256>(mask)));
#else
  uint32_t bits = 0;
  for (int lane = 0; lane < 8; ++lane) bits |= (mask[lane] ? 1u : 0u) << lane;
  return bits;
#endif
}
inline uint32_t BitsOf(Mask4 mask) {
#ifdef __AVX__
  return static_cast<uint32_t>(_mm256_movemask_pd(reinterpret_cast<__m256d>(mask)));
#else
  uint32_t bits = 0;
  for (int lane = 0; lane < 4; ++lane) bits |= (mask[lane] ? 1u : 0u) << lane;
  return bits;
#endif
}

// Correctly rounded, like every operation here.
inline double SquareRoot(double a) {
  return std::sqrt(a);
}
inline Float8 SquareRoot(Float8 a) {
#ifdef __AVX__
  return reinterpret_cast<Float8>(_mm256_sqrt_ps(reinterpret_cast<__m256>(a)));
#else
  for (int lane = 0; lane < 8; ++lane) a[lane] = std::sqrt(a[lane]);
  return a;
#endif
}
inline Double4 SquareRoot(Double4 a) {
#ifdef __AVX__
  return reinterpret_cast<Double4>(_mm256_sqrt_pd(reinterpret_cast<__m256d>(a)));
#else
  for (int lane = 0; lane < 4; ++lane) a[lane] = std::sqrt(a[lane]);
  return a;
#endif
}

// A point or a vector: of numbers, or one per lane.
template <typename Number>
struct Triple {
  Number x, y, z;
};
using Triple1 = Triple<double>;
inline Triple1 ToTriple(const Eigen::Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}
inline Triple<Float8> SameInAllLanes(const Eigen::Vector3f& v) {
  return {Float8{} + v.x(), Float8{} + v.y(), Float8{} + v.z()};
}
inline Eigen::Vector3d ToEigen(const Triple1& v) {
  return {v.x, v.y, v.z};
}

template <typename Number>
Triple<Number> operator-(const Triple<Number>& a, const Triple<Number>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <typename Number>
Triple<Number> operator+(const Triple<Number>& a, const Triple<Number>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <typename Number>
Triple<Number> operator*(const Triple<Number>& a, Number b) {
  return {a.x * b, a.y * b, a.z * b};
}
template <typename Number>
Number Dot(const Triple<Number>& a, const Triple<Number>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <typename Number>
Triple<Number> Cross(const Triple<Number>& a, const Triple<Number>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

}  // namespace touchstone::geometry
