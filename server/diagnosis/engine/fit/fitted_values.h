// The free values of a fit as an uncertainty budget of pictures takes them.
#pragma once

#include <vector>

#include "server/diagnosis/engine/fit/parameterization.h"
#include "server/uncertainty/picture_budget.h"

namespace touchstone::diagnosis::engine {

// Free parameters whose effects `of` has: a model that was made from the fit's and lacks some of its effects.
std::vector<int> ValuesOfModel(const Parameterization& fitted, const model::Model& of);

// `values`: free parameters of the fit; `covariance` of all of them.
uncertainty::FittedValues FittedValuesOf(const Parameterization& fitted, const std::vector<int>& values,
                                         const Eigen::MatrixXd& covariance);

}  // namespace touchstone::diagnosis::engine
