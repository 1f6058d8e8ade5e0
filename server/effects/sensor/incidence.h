// The tangent and secant of the angle of incidence, kept finite where the finger only grazes the surface.
#pragma once

#include <Eigen/Core>

#include "server/effects/touch_batch.h"

namespace touchstone::effects {

// Below this cosine (89.94 deg) the tangent of the incidence is held: it would grow without bound.
inline constexpr double kMinCosIncidence = 1e-3;

// tan(inc) of every finger, in the order of the batch's arrays. Entries of fingers without contact mean
// nothing.
inline auto TanIncidence(const TouchBatch& touches) {
  const Eigen::Map<const Eigen::ArrayXd> cosine(touches.cos_incidence.data(), touches.cos_incidence.size());
  const auto held = cosine.max(kMinCosIncidence);
  return ((1.0 - held * held).max(0.0).sqrt() / held).eval();
}

}  // namespace touchstone::effects
