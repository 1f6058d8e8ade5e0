#include "server/base/numbers/random.h"

#include <Random123/philox.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#ifdef __AVX__
#include <immintrin.h>
#endif

#include "server/base/units.h"

namespace touchstone {
namespace {

double BitsToDouble(uint64_t bits) {
  double value;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

uint64_t DoubleToBits(double value) {
  uint64_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  return bits;
}

// log(x) for normal x > 0: x = 2^e * m with m in [sqrt(1/2), sqrt(2)), then the series of
// 2 atanh(z), z = (m - 1) / (m + 1), |z| < 0.172: the truncated tail is below 1e-17.
inline double Log(double x) {
  const uint64_t bits = DoubleToBits(x);
  const uint64_t kSqrtHalfBits = 0x3FE6A09E667F3BCDull;
  const uint64_t shifted = bits - kSqrtHalfBits;
  // The exponent, arithmetic shift by 52, as a double without an integer conversion (AVX2 has none).
  const uint64_t biased = (shifted >> 52) ^ 0x800ull;  // sign bit of the 12-bit field flipped
  const double exponent =
      BitsToDouble(0x4330000000000000ull | (biased & 0xFFFull)) - 4503599627370496.0 - 2048.0;
  const double m = BitsToDouble(bits - ((shifted >> 52) << 52));
  const double z = (m - 1.0) / (m + 1.0);
  const double w = z * z;
  const double series =
      1.0 + w * (1.0 / 3 +
                 w * (1.0 / 5 +
                      w * (1.0 / 7 +
                           w * (1.0 / 9 +
                                w * (1.0 / 11 +
                                     w * (1.0 / 13 + w * (1.0 / 15 + w * (1.0 / 17 + w * (1.0 / 19)))))))));
  return exponent * 0.693147180559945309417 + 2.0 * z * series;
}

// cos and sin of 2 pi u, u in [0, 1): reduced to an eighth of the circle by quarter turns.
inline void CosSinTurn(double u, double* cosine, double* sine) {
  const double kShift = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to an integer
  const double rounded = u * 4.0 + kShift;
  const uint64_t quarter = DoubleToBits(rounded);
  const double a = (u * 4.0 - (rounded - kShift)) * (kPi / 2);  // |a| <= pi / 4
  const double w = a * a;
  const double s =
      a * (1.0 + w * (-1.0 / 6 +
                      w * (1.0 / 120 + w * (-1.0 / 5040 +
                                            w * (1.0 / 362880 + w * (-1.0 / 39916800 +
                                                                     w * (1.0 / 6227020800.0 +
                                                                          w * (-1.0 / 1307674368000.0))))))));
  const double c =
      1.0 +
      w * (-0.5 + w * (1.0 / 24 + w * (-1.0 / 720 +
                                       w * (1.0 / 40320 + w * (-1.0 / 3628800 +
                                                               w * (1.0 / 479001600.0 +
                                                                    w * (-1.0 / 87178291200.0 +
                                                                         w * (1.0 / 20922789888000.0))))))));
  // Quarter turn q: (c, s), (-s, c), (-c, -s), (s, -c); signs and the swap by bits, without a branch.
  const uint64_t swap = 0 - (quarter & 1);
  const uint64_t c_bits = DoubleToBits(c), s_bits = DoubleToBits(s);
  const uint64_t x = (s_bits & swap) | (c_bits & ~swap);
  const uint64_t y = (c_bits & swap) | (s_bits & ~swap);
  *cosine = BitsToDouble(x ^ (((quarter ^ (quarter >> 1)) & 1) << 63));
  *sine = BitsToDouble(y ^ (((quarter >> 1) & 1) << 63));
}

// The functions of the header, for inlining here.
inline std::array<uint64_t, 4> Block(uint64_t seed, RandomDomain domain, uint64_t index, uint64_t attempt,
                                     uint64_t block) {
  const r123::Philox4x64::ctr_type counter = {{block, index, attempt, 0}};
  const r123::Philox4x64::key_type key = {{seed, static_cast<uint64_t>(domain)}};
  const r123::Philox4x64::ctr_type words = r123::Philox4x64()(counter, key);
  return {words[0], words[1], words[2], words[3]};
}
inline double Uniform(uint64_t word) {
  return BitsToDouble((word >> 12) | 0x3FF0000000000000ull) - 1.0;
}

// Square roots in place. The C library's may set errno, which keeps a loop from being vectorised.
inline void SquareRoots(double* values, int count) {
  int k = 0;
#ifdef __AVX__
  for (; k + 4 <= count; k += 4) _mm256_storeu_pd(values + k, _mm256_sqrt_pd(_mm256_loadu_pd(values + k)));
#endif
  for (; k < count; ++k) values[k] = std::sqrt(values[k]);
}

// Deviates that are computed together.
constexpr int kTile = 256;

// Two deviates from two words (Box-Muller), for `count` <= kTile pairs. 1 - u lies in (0, 1], so the
// logarithm is finite.
inline void NormalPairs(const uint64_t* first, const uint64_t* second, int count, double* a, double* b) {
  double radius[kTile];
  for (int k = 0; k < count; ++k) radius[k] = -2.0 * Log(1.0 - Uniform(first[k]));
  SquareRoots(radius, count);
  for (int k = 0; k < count; ++k) CosSinTurn(Uniform(second[k]), &a[k], &b[k]);
  for (int k = 0; k < count; ++k) {
    a[k] = radius[k] * a[k];
    b[k] = radius[k] * b[k];
  }
}

}  // namespace

std::array<uint64_t, 4> RandomBlock(uint64_t seed, RandomDomain domain, uint64_t index, uint64_t attempt,
                                    uint64_t block) {
  return Block(seed, domain, index, attempt, block);
}

double UniformFromWord(uint64_t word) {
  return Uniform(word);
}

void FillNormals(uint64_t seed, RandomDomain domain, const uint64_t* indices, int count, int width,
                 double* normals) {
  const int pairs = (width + 1) / 2;
  double a[kTile], b[kTile];
  uint64_t first[kTile], second[kTile];
  for (int begin = 0; begin < count; begin += kTile) {
    const int n = std::min(kTile, count - begin);
    for (int pair = 0; pair < pairs; pair += 2) {
      // One block serves two pairs; the scalar generator runs first, then the vector arithmetic.
      uint64_t third[kTile], fourth[kTile];
      for (int k = 0; k < n; ++k) {
        const auto words = Block(seed, domain, indices[begin + k], 0, pair / 2);
        first[k] = words[0], second[k] = words[1], third[k] = words[2], fourth[k] = words[3];
      }
      for (int half = 0; half < 2 && pair + half < pairs; ++half) {
        const uint64_t* u = half == 0 ? first : third;
        const uint64_t* v = half == 0 ? second : fourth;
        NormalPairs(u, v, n, a, b);
        const int j = 2 * (pair + half);
        for (int k = 0; k < n; ++k) normals[(begin + k) * width + j] = a[k];
        if (j + 1 < width)
          for (int k = 0; k < n; ++k) normals[(begin + k) * width + j + 1] = b[k];
      }
    }
  }
}

uint64_t RandomStream::Word() {
  if (used_ == 4) {
    words_ = Block(seed_, domain_, index_, attempt_, next_block_++);
    used_ = 0;
  }
  return words_[used_++];
}

uint64_t RandomStream::Below(uint64_t bound) {
  // The high half of a 64 x 64 product: a bias below bound / 2^64.
  return static_cast<uint64_t>((static_cast<unsigned __int128>(Word()) * bound) >> 64);
}

double RandomStream::Normal() {
  double a, b;
  const uint64_t first = Word(), second = Word();
  NormalPairs(&first, &second, 1, &a, &b);
  return a;
}

}  // namespace touchstone
