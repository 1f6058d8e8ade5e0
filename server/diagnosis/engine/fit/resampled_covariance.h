// How sure fitted values are, from drawing blocks again.
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "server/diagnosis/engine/fit/fit.h"

namespace touchstone::diagnosis::engine {

// Covariance of the free parameters over sets of as many blocks, drawn with replacement from the experiment's: one linear
// step from the fit each, without a smooth error. The seed draws. Two blocks or fewer: zero.
Eigen::MatrixXd ResampledCovariance(const Experiment& experiment, const Fit& fit, uint64_t seed);

}  // namespace touchstone::diagnosis::engine
