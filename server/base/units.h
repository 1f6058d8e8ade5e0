// The one place that converts between the units of files and the command line (what labs write:
// mm, us, deg, mm/s) and SI (m, s, rad, m/s), which is used everywhere inside and on the wire.
#pragma once

#include <absl/strings/string_view.h>

namespace touchstone {

inline constexpr double kPi = 3.14159265358979323846;

// A unit of files and of the command line. The name of every dimensional parameter ends in its suffix.
enum class Unit {
  kNone,                        // ratios, counts, probabilities; no suffix
  kMillimetre,                  // _mm,         SI m
  kDegree,                      // _deg,        SI rad
  kMicrosecond,                 // _us,         SI s
  kSecond,                      // _s,          SI s
  kMillimetrePerSecond,         // _mm_s,       SI m/s
  kMillimetrePerSecondSquared,  // _mm_s2,      SI m/s^2
  kMillimetrePerHour,           // _mm_per_h,   SI m/s
  kPerMetre,                    // _per_m,      SI 1/m
  kPixel,                       // _px,         the same inside: images have no other
  kGreyLevel,                   // _grey,       the same inside: 0 to 255
};

// The factor that turns a number of files into SI: si = file * SiFactor(unit).
double SiFactor(Unit unit);
inline double ToSi(Unit unit, double value) {
  return value * SiFactor(unit);
}
inline double FromSi(Unit unit, double value) {
  return value / SiFactor(unit);
}

// "mm", "deg", "us", "mm/s", ...; empty for kNone.
absl::string_view UnitSymbol(Unit unit);

// "_mm", "_deg", ...; empty for kNone.
absl::string_view UnitSuffix(Unit unit);

// The unit whose symbol is `symbol` ("" is kNone). Returns false if there is none.
bool UnitFromSymbol(absl::string_view symbol, Unit* unit);

// Plain shorthands of the same factors for code that handles one known unit, and their reciprocals (powers of
// ten below 1 are not exact: dividing by 1e-6 and multiplying by 1e6 differ in the last digit).
inline constexpr double kMetresPerMillimetre = 1e-3;
inline constexpr double kMillimetresPerMetre = 1e3;
inline constexpr double kSecondsPerMicrosecond = 1e-6;
inline constexpr double kMicrosecondsPerSecond = 1e6;
inline double Microseconds(double time_s) {
  return time_s * kMicrosecondsPerSecond;
}
inline constexpr double kSecondsPerMillisecond = 1e-3;
inline constexpr double kMillisecondsPerSecond = 1e3;
inline constexpr double kRadiansPerDegree = kPi / 180.0;

}  // namespace touchstone
