// What the values of a fit leave open of every expected photograph, as a budget: grey levels.
#pragma once

#include <vector>

#include "server/diagnosis/engine/fit/fit.h"
#include "server/diagnosis/images/photographs.h"
#include "server/uncertainty/budget.h"

namespace touchstone::diagnosis::images {

// Of the free values of `fit` whose effects `improved` has; `covariance` of all free values of the fit. `noise_grey`: of one
// pixel. Simulates at most ImageRules::max_budget_photographs, evenly chosen, twice per value: one standard error below and
// above it; contours move with the picture's flow between the two (photo_flow.h).
// Errors are those of the simulator.
absl::StatusOr<std::vector<uncertainty::Budget>> BudgetOfPhotographs(const Photographs& photographs,
                                                                     const engine::Fit& fit,
                                                                     const Eigen::MatrixXd& covariance,
                                                                     const model::Model& improved,
                                                                     double noise_grey, ThreadPool* pool);

}  // namespace touchstone::diagnosis::images
