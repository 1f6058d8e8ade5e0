// Touches that could be made next.
#pragma once

#include <absl/status/statusor.h>

#include "server/diagnosis/touches/observations.h"
#include "server/model/model.h"

namespace touchstone::diagnosis::design {

struct CandidateChoice {
  int max_candidates = 1500;     // about, all objects and speeds together
  double max_tilt_rad = 0.7;     // between the approach and a face of the bounding box
  bool different_times = false;  // also at the beginning of a session, for models that drift
  uint64_t seed = 0;
};

// Observations of touches that every finger of `model` completes, none within 1 mm of a sharp edge; their
// times are unknown (0). Speeds: half, once and twice the median of `observations`.
absl::StatusOr<touches::Observations> MakeCandidates(const touches::Observations& observations,
                                                     const model::Model& model, const CandidateChoice& choice,
                                                     ThreadPool* pool);

// The touches `keep` of `observations`, in that order. A previous touch that is not kept becomes none.
touches::Observations PartOf(const touches::Observations& observations, const std::vector<int>& keep);

}  // namespace touchstone::diagnosis::design
