// What photographs may show beside effects of the catalogue, and what a search of them finds of its own steps. How each is
// found stands in a file of its own.
#pragma once

#include <vector>

#include "server/diagnosis/engine/ladder/hypotheses.h"

namespace touchstone::diagnosis::images {

// In the order in which they are asked.
struct PhotoHypothesis {
  enum {
    // Of the explanation that a search has found (search/photo_search.h).
    kFaintField,   // an image field that is no larger than what simulation and noise are known to
    kUnsteady,     // a step that the scatter between pictures could make go
    kLargeStep,    // a step that takes most of what is left, beside a rest
    kChoice,       // a value that is one of few
    kWithoutGain,  // a step with which the error does not fall
    // Of what it leaves (photo_ladder.cpp).
    kMisfit,       // a lack of fit, of whatever kind
    kAlbedo,       // the light of the objects' surfaces differs from place to place (PhotoRows::albedo)
    kDependence,   // what is left follows a covariate (rows/photo_covariates.h)
    kImageField,   // grey levels at their places of every picture (pixels/image_field.h)
    kSuggestion,   // a formula or a curve over pixels (terms/photo_formula.h)
    kKindOfRest,   // of a known kind, which no effect explains (rows/photo_rest_kinds.h)
    kUnevenNoise,  // the noise of pixels differs between parts of the set (rows/photo_uneven_noise.h)
    kUnknown,      // nothing that was tried
  };
};

const std::vector<engine::HypothesisRule>& PhotoHypothesisRules();

}  // namespace touchstone::diagnosis::images
