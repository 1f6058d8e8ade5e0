// A formula or a curve for what no effect of the catalogue explains in photographs: a suggestion, held to the same rules
// as for touches (selection/curves/formula_terms.h, nameless_curve.h).
#pragma once

#include <optional>
#include <string>

#include <absl/status/statusor.h>

#include "server/diagnosis/images/photographs.h"

namespace touchstone::diagnosis::images {

struct RestSuggestion {
  std::string formula, formula_yaml;  // empty: no formula says what the curve says
  model::Model with;                  // the model with it
  std::string lookup_yaml;            // empty: none, or the formula stands in its place
  std::string covariate;              // that it follows
  double rmse_grey = 0;               // that a comparison with the model and the suggestion finds
  double heldout_rmse_grey = 0;       // the same of poses that it was not fitted to
  double heldout_gain = 0;            // share of the held-out excess error that it removes, 0 to 1
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
