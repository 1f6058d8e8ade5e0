// A formula or a curve for what no effect of the catalogue explains in photographs: a suggestion, held to the same rules
// as for touches (selection/curves/formula_terms.h, nameless_curve.h).
#pragma once

#include <optional>
#include <string>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/images/photographs.h"

namespace touchstone::diagnosis::images {

struct RestSuggestion : engine::UnexplainedRest {  // what it says of one, and the errors with it, grey levels
  engine::CovariateTest follows;  // by the suggestion's own test, all that were tried paid for
};

struct RestErrors {
  double rmse_grey = 0, heldout_rmse_grey = 0, floor_grey = 0;  // of the model without a suggestion
};

// On what `model` leaves. `photographs`: as comparisons take them; `judged`: the same with the noise of what is left. It
// is paid for by its evidence, with the scatter between poses as noise and the dictionary's size paid for; predicts poses
// and objects that it was not fitted to; is nearly as good there as grey levels that stay at their places in the picture,
// or on the objects, whatever they are (dirt on the lens, paint); and takes a fifth of the excess error or more.
// Errors as ExpectPhotographs.
absl::StatusOr<std::optional<RestSuggestion>> SuggestForRest(const Photographs& photographs,
                                                             const Photographs& judged,
                                                             const model::Model& model,
                                                             const RestErrors& errors, ThreadPool* pool);

}  // namespace touchstone::diagnosis::images
