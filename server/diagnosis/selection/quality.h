// How good a model is: error, error on touches left out, lack of fit.
#pragma once

#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/selection/selection.h"

namespace touchstone::diagnosis::selection {

// What times are off by because numbers of files and meshes are rounded, s: the least that a floor can be.
double RoundingS(const touches::Observations& observations);

// F test of residuals against the scatter of repeats; `parameters` of the model were fitted. 1 without repeats or
// without degrees of freedom.
double LackOfFitP(const touches::Observations& observations, const std::vector<double>& residuals,
                  double parameters);

// Repeats enough for an F test.
bool HasRepeats(const touches::SumOfSquares& error);

// Held-out error over error of a fit, on the touches of the search. By least squares it is at least 1; weights that differ
// between the two must not make it less.
double HeldOutRatio(const engine::Fit& fit, double heldout_rmse_s);

// Of the model of a fit (or of part of its effects), on all touches; the ratio of the held-out error to the error
// comes from the touches of the search, with every value fitted anew (engine/fit/held_out.h).
absl::StatusOr<engine::Quality> QualityOf(const Workspace& workspace, const engine::Fit& fit,
                                          const std::vector<double>& residuals);

// The touches `used` ([k]) that a comparison with `model` uses too: it meets the object in them, and no edge. `prediction`:
// of the model.
absl::StatusOr<touches::Observations> UsableUnder(const Workspace& workspace, const model::Model& model,
                                                  const touches::Prediction& prediction,
                                                  const std::vector<char>& used);

// What a comparison of the set with `model` finds, s: the same touches, every one of them.
absl::StatusOr<double> ErrorAsCompared(const Workspace& workspace, const model::Model& model);

// Of `model`, which has the values of a fit to the touches of the search: as compared, and as QualityOf.
absl::StatusOr<engine::Quality> QualityOfModel(const Workspace& workspace, const engine::Fit& fit,
                                               const model::Model& model);

// The same of the model as it was given; `residuals`: of every touch that takes part.
engine::Quality QualityAsCompared(const touches::Observations& observations,
                                  const std::vector<double>& residuals);

// Another error, s, of the same fit; the held-out error keeps its ratio to it.
void SetError(double rmse_s, engine::Quality* quality);

// The same for what the fit's surface error leaves, on the touches of the search.
engine::Quality QualityWithoutSurface(const Workspace& workspace, const engine::Fit& fit);

// The floor below which no model can go, from the repeats, else from `best`, residuals of the best model.
engine::NoiseFloor NoiseFloorOf(const touches::Observations& observations, const std::vector<double>& best,
                                double fitted_parameters);

}  // namespace touchstone::diagnosis::selection
