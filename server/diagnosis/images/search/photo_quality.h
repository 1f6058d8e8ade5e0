// How good a model of photographs is: errors over all pixels, the floor below which none can go, lack of fit.
#pragma once

#include "server/diagnosis/images/photograph_diagnosis.h"
#include "server/diagnosis/images/photographs.h"
#include "server/diagnosis/images/search/photo_search.h"

namespace touchstone::diagnosis::images {

// From repeats of a pose where there are enough, else from what neighbouring pixels of the residuals differ by.
// `expected`: of the best model.
engine::NoiseFloor NoiseFloorOfPhotographs(const Photographs& photographs,
                                           const std::vector<image::Photo>& expected, ThreadPool* pool);

// The noise of single pixels of what `expected` leaves, rounding to 8 bits included.
PixelNoise NoiseOfResiduals(const Photographs& photographs, const std::vector<image::Photo>& expected,
                            ThreadPool* pool);

// The variance of a contour's place, px^2, that `expected` leaves: what pixels near contours scatter beyond their noise,
// over the squares of the contours' steps. Between a least that simulations of one scene differ by and kUnknownPlacePx2.
double ContourPlaceVariance(const Photographs& photographs, const std::vector<image::Photo>& expected,
                            ThreadPool* pool);

// P of at least this misfit of patches of some pixels if nothing but noise were there; the noise's variance is taken to
// be known to a twentieth. `parameters` were fitted.
double PatchMisfitP(const Photographs& photographs, const std::vector<image::Photo>& expected, int parameters,
                    ThreadPool* pool);

// Error and lack of fit; the held-out error is the same error, as it is where nothing was fitted.
engine::Quality QualityOfPhotographs(const Photographs& photographs,
                                     const std::vector<image::Photo>& expected, int parameters,
                                     ThreadPool* pool);

// The same of single pixels, whose error at contours patches hardly count: lowers quality->lack_of_fit_p where the error
// lies farther above the floor than contours that were sampled at pixel centres explain (a tenth).
void AssessByPixels(const Photographs& photographs, const engine::NoiseFloor& floor,
                    engine::Quality* quality);

// The error on photographs that a fit did not see over the error on the same photographs where it saw them, over all
// their pixels; at least 1. The fit is made anew without each object, without each fifth of the poses and without each
// fifth of the session (engine/fit/held_out.h): of the three the largest. `experiment`: of these rows. Errors as
// engine::RefitWithoutParts.
absl::StatusOr<double> HeldOutRatio(const Photographs& photographs, const PhotoRows& rows,
                                    const engine::Experiment& experiment, const engine::Fit& fit);

// For a ranking of many fits, quickly: what pictures have as mean square grey levels beyond those that the fit saw, where
// one linear step of it makes up for what is left out. Of a step that is claimed, see HeldOutRatio.
double HeldOutExcess(const PhotoSearch& search, const engine::Fit& fit, const Photographs& photographs,
                     double floor_grey);

}  // namespace touchstone::diagnosis::images
