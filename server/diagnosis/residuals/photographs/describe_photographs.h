// Where photographs differ from what a model expects: parts of the pictures that a person can picture, curves, outlines,
// the pictures one by one. Residuals are measured minus expected grey levels, pixel by pixel.
#pragma once

#include "server/base/threads/thread_pool.h"
#include "server/diagnosis/images/photograph_diagnosis.h"
#include "server/diagnosis/images/photographs.h"

namespace touchstone::diagnosis::residuals {

// Fills silhouettes, where, curves, photographs and maps from what was expected (with details) and the noise floor of
// the diagnosis. A pure function of its arguments, whatever the number of threads.
//
// Slices: thresholds are found on half of the poses and kept only if the other half agrees. Curves: p by exchanging the
// signs of whole pictures (of what varies within them), or their places in time, corrected for the number of curves; so
// what neighbouring pixels share does no harm. Silhouettes: see photograph_silhouette.h; means over the pictures that
// can tell.
void DescribePhotographs(const images::Expectation& expectation, uint64_t seed, ThreadPool* pool,
                         images::PhotographDiagnosis* diagnosis);

}  // namespace touchstone::diagnosis::residuals
