// Touches that could be made next.
#pragma once

#include <absl/status/statusor.h>

#include "server/diagnosis/touches/observations.h"
#include "server/model/model.h"

namespace touchstone {

struct CandidateChoice {
  int most = 1500;               // candidates
  double max_tilt_rad = 0.7;     // between the approach and a face of the bounding box
  bool different_times = false;  // also at the beginning of a session, for what drifts
  uint64_t seed = 0;
};

// An experiment of touches that every finger of `model` completes, none within 1 mm of a sharp edge; times
// are unknown. Speeds: half, once and twice the median of `observations`.
absl::StatusOr<Observations> MakeCandidates(const Observations& observations, const Model& model,
                                            const CandidateChoice& choice, ThreadPool* pool);

// Part of an experiment: touches `keep`, in their order. Previous touches outside of it are forgotten.
Observations PartOf(const Observations& observations, const std::vector<int>& keep);

}  // namespace touchstone
