// What a commanded touch may be, wherever it comes from: a message, a file or a journal. SI units.
#pragma once

#include <Eigen/Core>

namespace touchstone {

inline constexpr double kMaxTargetM = 100;   // every coordinate of the target
inline constexpr double kMaxStandoffM = 10;  // from 0
// Where no stroke is given, an approach on a rig ends so far behind its target, unless the rig is set otherwise.
inline constexpr double kDefaultStrokeBeyondTargetM = 0.03;
inline constexpr double kMaxSpeedMS = 10;        // above 0
inline constexpr double kMaxSessionTimeS = 1e9;  // from 0

// Lengths may differ from 1 by this much, the cosine between approach and lateral from 0.
inline constexpr double kVectorTolerance = 1e-3;

enum class VectorFlaw {
  kNone,
  kApproachLength,  // no unit vector, or not finite
  kLateralLength,
  kNotPerpendicular
};

// Makes approach and lateral exactly unit and perpendicular: lengths are divided out, and lateral is turned
// about what remains of its part along approach. Vectors that are exact to rounding stay as they are, so that
// doing it again changes nothing and what was written is read back bit for bit. Beyond the tolerance: says what
// is wrong and leaves that vector as it is.
VectorFlaw MakeOrthonormal(Eigen::Vector3d* approach, Eigen::Vector3d* lateral);

}  // namespace touchstone
