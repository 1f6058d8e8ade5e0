// Powers of light in loops that the compiler turns into vector instructions, the same bits on every machine: the C
// library's may differ. Relative error below 1e-6 for x from 1e-30 to 4 and |exponent * log2(x)| < 120.
#pragma once

#include <cstdint>
#include <cstring>

namespace touchstone::image {

// log2 of a normal, positive number: the exponent, and a series in (m - 1) / (m + 1) of the mantissa.
inline float Log2Of(float x) {
  int32_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  // Mantissa from sqrt(1/2) to sqrt(2).
  const int32_t shifted = bits - 0x3F3504F3;
  const int32_t whole = shifted >> 23;
  const int32_t mantissa_bits = (shifted & 0x007FFFFF) + 0x3F3504F3;
  float mantissa;
  std::memcpy(&mantissa, &mantissa_bits, sizeof mantissa);
  const float s = (mantissa - 1.0f) / (mantissa + 1.0f), t = s * s;
  // 2 / ln 2 * (1, 1/3, 1/5, 1/7, 1/9)
  const float series =
      s *
      (2.885390082f + t * (0.9617966939f + t * (0.5770780164f + t * (0.4121985831f + t * 0.3205988980f))));
  return static_cast<float>(whole) + series;
}

inline float Exp2Of(float x) {
  const float kept = x < -126.0f ? -126.0f : (x > 126.0f ? 126.0f : x);
  const float shifted = kept + 12582912.0f;  // 1.5 * 2^23: rounds to the nearest whole number
  const float whole = shifted - 12582912.0f;
  const float f = kept - whole;  // -1/2 to 1/2
  // ln(2)^n / n!
  const float fraction =
      1.0f +
      f * (0.6931471806f +
           f * (0.2402265070f +
                f * (0.05550410866f + f * (0.009618129108f + f * (0.001333355815f + f * 0.0001540353039f)))));
  const int32_t bits = (static_cast<int32_t>(whole) + 127) << 23;
  float power;
  std::memcpy(&power, &bits, sizeof power);
  return fraction * power;
}

// x^exponent for x from 1e-30 on; 0 for smaller ones.
inline float PowerOf(float x, float exponent) {
  const float kept = x > 1e-30f ? x : 1e-30f;
  const float power = Exp2Of(exponent * Log2Of(kept));
  return x > 1e-30f ? power : 0.0f;
}

}  // namespace touchstone::image
