// What each effect that may be missing would change, to first order.
#pragma once

#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "server/diagnosis/engine/search/stepwise_search.h"

namespace touchstone::diagnosis::engine {

struct EffectColumns {
  Extension extension;
  Eigen::MatrixXd
      columns;  // rows x its values: derivatives of the predicted rows; empty where `shared` is not -1
  // Of an effect that acts on objects one by one: where the same effect on all of them stands, which has its columns.
  int shared = -1;
};

// The given model, and every way to extend it that a search tries.
struct GivenAndEffects {
  Fit given;
  std::vector<EffectColumns> effects;
};

// On the rows of the search. Errors as FitModel.
absl::StatusOr<GivenAndEffects> ColumnsOfEffects(const StepwiseSearch& search, const model::Model& given);

}  // namespace touchstone::diagnosis::engine
