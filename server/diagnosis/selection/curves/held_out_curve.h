// How well columns beside a fit predict what they were not fitted to.
#pragma once

#include <Eigen/Core>

#include "server/diagnosis/engine/fit/fit.h"
#include "server/diagnosis/touches/touch_observation_model.h"

namespace touchstone::diagnosis::selection {

// Root mean square of rows, s, fitted without a fifth of the poses (of the session's stretches, `of_time`) and measured
// there, without a surface: what holds elsewhere must not need one. `basis`: further columns, may be empty; `precision`:
// of their values' prior, over the variance of the noise.
double HeldOutBeside(const engine::Experiment& experiment, const touches::TouchObservationModel& touches,
                     const engine::Fit& fit, const Eigen::MatrixXd& basis, const Eigen::MatrixXd& precision,
                     bool of_time);

}  // namespace touchstone::diagnosis::selection
