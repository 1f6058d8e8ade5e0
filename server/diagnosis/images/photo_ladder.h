// From a selected explanation to what is said of it: the error after each step, refits, what remains, the improved model.
#pragma once

#include "server/diagnosis/images/photograph_diagnosis.h"
#include "server/diagnosis/images/search/photo_quality.h"
#include "server/diagnosis/images/search/photo_search.h"

namespace touchstone::diagnosis::images {

// Fills the improvement, noise floor and errors of `diagnosis`; `after`: the
// pictures that the improved model expects, empty if nothing changed.
absl::Status DescribeExplanation(const DiagnosisInput& input, const DiagnosisContext& context,
                                 const Photographs& photographs, const PhotoSelection& selection,
                                 const std::vector<image::Photo>& before, PhotographDiagnosis* diagnosis,
                                 std::vector<image::Photo>* after);

// The noise of the pixels as a step or a refit of the improved model.
void AddPixelNoise(const PixelNoise& found, int channels, const engine::Quality& quality,
                   engine::Improvement* improvement);

}  // namespace touchstone::diagnosis::images
