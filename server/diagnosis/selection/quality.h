// How good a model is: error, error on touches left out, lack of fit (DESIGN 8).
#pragma once

#include "server/diagnosis/selection/explain.h"

namespace touchstone {

// F test of residuals against the scatter of repeats; `parameters` of the model were fitted. 1 without
// repeats or without degrees of freedom.
double LackOfFitP(const Observations& observations, const std::vector<double>& residuals, double parameters);

// Repeats enough for an F test.
bool HasRepeats(const SumOfSquares& error);

// Of the model of a fit (or of part of its effects), on all touches. `heldout_share`: error on touches left
// out over that on all, from the search. `surface`: judge what a surface error leaves (searched touches).
v1::Quality QualityOf(const Study& study, const Search& search, const Fit& fit,
                      const std::vector<double>& residuals, bool surface);

// The floor below which no model can go, from the repeats, else from `best`, residuals of the best model.
v1::NoiseFloor NoiseFloorOf(const Observations& observations, const std::vector<double>& best,
                            double fitted_parameters);

}  // namespace touchstone
