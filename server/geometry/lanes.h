// Eight single-precision numbers that are computed with together (GCC and Clang vector extensions): AVX
// registers where there are any, narrower ones elsewhere.
#pragma once

#include <cstdint>
#include <cstring>

#ifdef __AVX__
#include <immintrin.h>
#endif

namespace touchstone {

typedef float Lanes __attribute__((vector_size(32)));
typedef int32_t LaneMask __attribute__((vector_size(32)));  // -1 or 0 a lane, from comparisons

inline Lanes LoadLanes(const float* from) {
  Lanes lanes;
  std::memcpy(&lanes, from, sizeof(lanes));
  return lanes;
}
inline void StoreLanes(float* to, Lanes lanes) { std::memcpy(to, &lanes, sizeof(lanes)); }

inline Lanes Select(LaneMask mask, Lanes if_true, Lanes if_false) { return mask ? if_true : if_false; }

// One bit a lane.
inline uint32_t MaskOf(LaneMask mask) {
#ifdef __AVX__
  return static_cast<uint32_t>(_mm256_movemask_ps(reinterpret_cast<__m256>(mask)));
#else
  uint32_t bits = 0;
  for (int lane = 0; lane < 8; ++lane) bits |= (mask[lane] ? 1u : 0u) << lane;
  return bits;
#endif
}

inline Lanes MaxLanes(Lanes a, Lanes b) { return a > b ? a : b; }
inline Lanes MinLanes(Lanes a, Lanes b) { return a < b ? a : b; }

inline Lanes SqrtLanes(Lanes a) {
#ifdef __AVX__
  return reinterpret_cast<Lanes>(_mm256_sqrt_ps(reinterpret_cast<__m256>(a)));
#else
  for (int lane = 0; lane < 8; ++lane) a[lane] = __builtin_sqrtf(a[lane]);
  return a;
#endif
}

// A point or vector a lane.
struct Lanes3 {
  Lanes x, y, z;
};
inline Lanes3 operator-(const Lanes3& a, const Lanes3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Lanes3 operator*(const Lanes3& a, Lanes b) { return {a.x * b, a.y * b, a.z * b}; }
inline Lanes3 operator+(const Lanes3& a, const Lanes3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Lanes Dot(const Lanes3& a, const Lanes3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Lanes3 Cross(const Lanes3& a, const Lanes3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

}  // namespace touchstone
