// Everything that a diagnosis prepares once: which touches take part, what the initial model predicts, the
// likelihood. Large sets are thinned for the search; values and errors are measured on all touches.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/fit/fit.h"
#include "server/diagnosis/input.h"
#include "server/diagnosis/touches/touch_observation_model.h"

namespace touchstone::diagnosis::selection {

struct Workspace {
  DiagnosisInput input;
  DiagnosisContext context;
  std::unique_ptr<touches::Observations> observations;  // every touch
  std::unique_ptr<touches::Predictor> predictor;
  touches::Prediction nominal;  // of the initial model, with details
  std::vector<std::string> warnings;
  // Touches that a comparison uses, whatever the model, as long as it meets the object and no edge. [k]
  std::vector<char> comparable;

  std::vector<double> weights_by_row;  // of the set's rows, in every fit; empty: all 1

  // What the search sees.
  std::unique_ptr<touches::Observations> searched;
  std::unique_ptr<touches::Predictor> searched_predictor;
  touches::Prediction searched_nominal;
  std::unique_ptr<touches::Contrasts> contrasts;
  std::unique_ptr<touches::TouchObservationModel> rows;
  std::unique_ptr<engine::Likelihood> likelihood;
  engine::Experiment experiment;
  bool thinned = false;
};

// Errors: input that contradicts itself, a mesh that most touches miss, times in the wrong unit.
absl::StatusOr<std::unique_ptr<Workspace>> MakeWorkspace(const DiagnosisInput& input,
                                                         const DiagnosisContext& context);

// Contrasts of the touches of `observations`, weighed as the noise asks for.
touches::Contrasts WeighedContrasts(const Workspace& workspace, const touches::Observations& observations,
                                    const std::vector<double>& expected_s);

// Chooses the touches of the search anew, after some were left out. `weights_by_row`: of the set's rows (empty: all 1).
absl::Status PrepareSearch(Workspace* workspace, const std::vector<double>& weights_by_row);

// Leaves out touches of which the model expects fewer than two of the reporting fingers to meet the object.
void LeaveOutMissed(const touches::Prediction& prediction, touches::Observations* observations);

// Where a small move of the tool makes a finger meet another part of the object, the time says more about the
// edge than about the rig, and a fit would chase it. Leaves such touches out; returns how many are new.
absl::StatusOr<int> LeaveOutEdges(const touches::Predictor& predictor, const model::Model& model,
                                  touches::Observations* observations);

// Pure error of residuals [k * fingers + i] among repeats: touches of one pose with the same fingers.
touches::SumOfSquares PureErrorOf(const touches::Observations& observations,
                                  const std::vector<double>& residuals);

}  // namespace touchstone::diagnosis::selection
