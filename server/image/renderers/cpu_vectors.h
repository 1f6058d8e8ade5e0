// Vectors of the widest kind that a file is compiled for, with the few operations that GCC's vector types lack. Everything
// has internal linkage, so that files for different processors keep their own. Part of the CPU renderer only.
#pragma once

#include <cstdint>

#ifdef __AVX2__
#include <immintrin.h>
#endif

namespace touchstone::image {
namespace {

#ifdef __AVX512F__
constexpr int kWide = 16;
#else
constexpr int kWide = 8;
#endif
typedef float Floats __attribute__((vector_size(kWide * sizeof(float))));
typedef int32_t Ints __attribute__((vector_size(kWide * sizeof(int32_t))));

// Triangles of fine meshes are a few pixels wide: they are drawn eight pixels at a time.
constexpr int kDrawn = 8;
typedef float DrawnFloats __attribute__((vector_size(kDrawn * sizeof(float))));
typedef int32_t DrawnInts __attribute__((vector_size(kDrawn * sizeof(int32_t))));
inline DrawnFloats DrawnSteps() {
  return DrawnFloats{0, 1, 2, 3, 4, 5, 6, 7};
}

template <typename Vector, typename Element>
inline Vector Load(const Element* from) {
  Vector vector;
  __builtin_memcpy(&vector, from, sizeof vector);
  return vector;
}
template <typename Vector, typename Element>
inline void Save(const Vector& vector, Element* to) {
  __builtin_memcpy(to, &vector, sizeof vector);
}

inline Floats Min(Floats a, Floats b) {
  return a < b ? a : b;
}
inline Floats Max(Floats a, Floats b) {
  return a > b ? a : b;
}
inline int Smaller(int a, int b) {
  return a < b ? a : b;
}
inline int Larger(int a, int b) {
  return a > b ? a : b;
}
inline int CeilToInt(float x) {
  return static_cast<int>(__builtin_ceilf(x));
}
inline int FloorToInt(float x) {
  return static_cast<int>(__builtin_floorf(x));
}

inline Ints Steps() {
  Ints steps{};
  for (int i = 0; i < kWide; ++i) steps[i] = i;
  return steps;
}

// The first `count` entries, the others `fill`.
template <typename Vector, typename Element>
inline Vector LoadSome(const Element* from, int count, Element fill) {
  Vector vector;
  for (int i = 0; i < kWide; ++i) vector[i] = i < count ? from[i] : fill;
  return vector;
}
inline Ints LoadUpTo(const int32_t* from, int count, int32_t fill) {
  return count >= kWide ? Load<Ints>(from) : LoadSome<Ints>(from, count, fill);
}
inline Floats LoadUpTo(const float* from, int count, float fill) {
  return count >= kWide ? Load<Floats>(from) : LoadSome<Floats>(from, count, fill);
}

#if defined(__AVX512F__)

// Six numbers of each of kWide vertices, by number: fields[k][i] = vertices[6 * vertex[i] + k]. Rows are loaded and
// transposed: processors fetch scattered numbers one by one.
inline void FetchVertices(const float* vertices, const uint32_t* vertex, Floats* fields) {
  const auto pair = [&](int i, int j) {
    const __m256 low = _mm256_maskz_loadu_ps(0x3F, vertices + 6 * static_cast<uint64_t>(vertex[i]));
    const __m256 high = _mm256_maskz_loadu_ps(0x3F, vertices + 6 * static_cast<uint64_t>(vertex[j]));
    return _mm512_insertf32x8(_mm512_castps256_ps512(low), high, 1);
  };
  __m512 quads[2][4];  // by field modulo 4: of the lanes 0 to 7, 8 to 15
  for (int half = 0; half < 2; ++half) {
    __m512 row[4];
    for (int i = 0; i < 4; ++i) row[i] = pair(8 * half + i, 8 * half + i + 4);
    const __m512 low01 = _mm512_unpacklo_ps(row[0], row[1]), high01 = _mm512_unpackhi_ps(row[0], row[1]);
    const __m512 low23 = _mm512_unpacklo_ps(row[2], row[3]), high23 = _mm512_unpackhi_ps(row[2], row[3]);
    quads[half][0] = _mm512_shuffle_ps(low01, low23, 0x44);
    quads[half][1] = _mm512_shuffle_ps(low01, low23, 0xEE);
    quads[half][2] = _mm512_shuffle_ps(high01, high23, 0x44);
    quads[half][3] = _mm512_shuffle_ps(high01, high23, 0xEE);
  }
  for (int k = 0; k < 4; ++k) fields[k] = (Floats)_mm512_shuffle_f32x4(quads[0][k], quads[1][k], 0x88);
  for (int k = 0; k < 2; ++k) fields[4 + k] = (Floats)_mm512_shuffle_f32x4(quads[0][k], quads[1][k], 0xDD);
}
inline Floats Gather(const float* from, Ints index) {
  return (Floats)_mm512_i32gather_ps((__m512i)index, from, 4);
}
inline Ints GatherInts(const int32_t* from, Ints index) {
  return (Ints)_mm512_i32gather_epi32((__m512i)index, from, 4);
}
inline Floats Sqrt(Floats x) {
  return (Floats)_mm512_sqrt_ps((__m512)x);
}
inline Floats Floor(Floats x) {
  return (Floats)_mm512_roundscale_ps((__m512)x, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC);
}
inline Floats Ceil(Floats x) {
  return (Floats)_mm512_roundscale_ps((__m512)x, _MM_FROUND_TO_POS_INF | _MM_FROUND_NO_EXC);
}
inline __mmask16 Bits(Ints chosen) {
  return _mm512_movepi32_mask((__m512i)chosen);
}
inline bool Any(Ints chosen) {
  return Bits(chosen) != 0;
}
// Appends the chosen entries; the room behind them, up to kWide entries, is written too.
inline uint32_t AppendChosen(Ints value, Ints chosen, uint32_t* to) {
  Save((Ints)_mm512_maskz_compress_epi32(Bits(chosen), (__m512i)value), to);
  return static_cast<uint32_t>(__builtin_popcount(Bits(chosen)));
}
inline void SaveBytes(Ints value, Ints chosen, uint8_t* to) {
  _mm512_mask_cvtepi32_storeu_epi8(to, Bits(chosen), (__m512i)value);
}
inline void SaveChosen(Floats value, Ints chosen, float* to) {
  _mm512_mask_storeu_ps(to, Bits(chosen), (__m512)value);
}

#else

#ifdef __AVX2__
inline void FetchVertices(const float* vertices, const uint32_t* vertex, Floats* fields) {
  const __m256i six = _mm256_setr_epi32(-1, -1, -1, -1, -1, -1, 0, 0);
  __m256 quads[2][4];  // by field modulo 4: of the lanes 0 to 3, 4 to 7
  for (int half = 0; half < 2; ++half) {
    __m256 row[4];
    for (int i = 0; i < 4; ++i)
      row[i] = _mm256_maskload_ps(vertices + 6 * static_cast<uint64_t>(vertex[4 * half + i]), six);
    const __m256 low01 = _mm256_unpacklo_ps(row[0], row[1]), high01 = _mm256_unpackhi_ps(row[0], row[1]);
    const __m256 low23 = _mm256_unpacklo_ps(row[2], row[3]), high23 = _mm256_unpackhi_ps(row[2], row[3]);
    quads[half][0] = _mm256_shuffle_ps(low01, low23, 0x44);
    quads[half][1] = _mm256_shuffle_ps(low01, low23, 0xEE);
    quads[half][2] = _mm256_shuffle_ps(high01, high23, 0x44);
    quads[half][3] = _mm256_shuffle_ps(high01, high23, 0xEE);
  }
  for (int k = 0; k < 4; ++k) fields[k] = (Floats)_mm256_permute2f128_ps(quads[0][k], quads[1][k], 0x20);
  for (int k = 0; k < 2; ++k) fields[4 + k] = (Floats)_mm256_permute2f128_ps(quads[0][k], quads[1][k], 0x31);
}
#else
inline void FetchVertices(const float* vertices, const uint32_t* vertex, Floats* fields) {
  for (int k = 0; k < 6; ++k)
    for (int i = 0; i < kWide; ++i) fields[k][i] = vertices[6 * static_cast<uint64_t>(vertex[i]) + k];
}
#endif
#ifdef __AVX2__
inline Floats Gather(const float* from, Ints index) {
  return (Floats)_mm256_i32gather_ps(from, (__m256i)index, 4);
}
inline Ints GatherInts(const int32_t* from, Ints index) {
  return (Ints)_mm256_i32gather_epi32(from, (__m256i)index, 4);
}
#else
inline Floats Gather(const float* from, Ints index) {
  Floats values;
  for (int i = 0; i < kWide; ++i) values[i] = from[index[i]];
  return values;
}
inline Ints GatherInts(const int32_t* from, Ints index) {
  Ints values;
  for (int i = 0; i < kWide; ++i) values[i] = from[index[i]];
  return values;
}
#endif
inline Floats Sqrt(Floats x) {
  for (int i = 0; i < kWide; ++i) x[i] = __builtin_sqrtf(x[i]);
  return x;
}
inline Floats Floor(Floats x) {
  for (int i = 0; i < kWide; ++i) x[i] = __builtin_floorf(x[i]);
  return x;
}
inline Floats Ceil(Floats x) {
  for (int i = 0; i < kWide; ++i) x[i] = __builtin_ceilf(x[i]);
  return x;
}
inline bool Any(Ints chosen) {
  int32_t any = 0;
  for (int i = 0; i < kWide; ++i) any |= chosen[i];
  return any != 0;
}
inline uint32_t AppendChosen(Ints value, Ints chosen, uint32_t* to) {
  uint32_t count = 0;
  for (int i = 0; i < kWide; ++i) {
    to[count] = static_cast<uint32_t>(value[i]);
    count += chosen[i] != 0;
  }
  return count;
}
inline void SaveBytes(Ints value, Ints chosen, uint8_t* to) {
  for (int i = 0; i < kWide; ++i)
    if (chosen[i] != 0) to[i] = static_cast<uint8_t>(value[i]);
}
inline void SaveChosen(Floats value, Ints chosen, float* to) {
  for (int i = 0; i < kWide; ++i)
    if (chosen[i] != 0) to[i] = value[i];
}

#endif

}  // namespace
}  // namespace touchstone::image
