// Everything that a diagnosis prepares once: which touches take part, what the given model predicts, the
// likelihood. Large sets are thinned for the search; values and errors are measured on all touches.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/inference/fit.h"

namespace touchstone {

// The search works on at most so many touches: its likelihood costs the square of an object's touches.
inline constexpr int kMaxSearched = 2400;

struct Study {
  DiagnosisInput input;
  DiagnosisContext context;
  std::unique_ptr<Observations> observations;  // every touch
  std::unique_ptr<Predictor> predictor;
  Prediction nominal;  // of the given model, with details
  std::vector<std::string> warnings;

  // What the search sees.
  std::unique_ptr<Observations> searched;
  std::unique_ptr<Predictor> searched_predictor;
  Prediction searched_nominal;
  std::unique_ptr<Contrasts> contrasts;
  std::unique_ptr<Likelihood> likelihood;
  Experiment experiment;
  bool thinned = false;
};

// Errors: input that contradicts itself, a mesh that most touches miss, times in the wrong unit.
absl::StatusOr<std::unique_ptr<Study>> MakeStudy(const DiagnosisInput& input,
                                                 const DiagnosisContext& context);

// Chooses the touches of the search anew, after some were left out. `weights` of the touches of
// study->searched->row (empty: all 1).
absl::Status PrepareSearch(Study* study, const std::vector<double>& weights_by_row);

// Where a small move of the tool makes a finger meet another part of the object, the time says more about the
// edge than about the rig, and a fit would chase it. Leaves such touches out; returns how many are new.
absl::StatusOr<int> LeaveOutEdges(const Predictor& predictor, const Model& model, Observations* observations);

// Pure error of residuals (contrasts) among repeats: touches of one pose with the same fingers.
SumOfSquares PureErrorOf(const Observations& observations, const std::vector<double>& residuals);

}  // namespace touchstone
