// Which of many possible measurements to make next, one after the other: touches and photographs alike.
//
// T-optimal (Atkinson and Fedorov 1975): a measurement is worth what the best model and a competing one predict
// differently after the latter has been fitted again to all data, the new measurements included; both ways round. With
// one model: where its values would be learnt best (D-optimal).
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/design/linearised_prediction.h"

namespace touchstone::diagnosis::design {

struct ChoiceRules {
  int max_choices = 0;
  double min_separation = 0.5;  // squared sigmas in all, below which no measurement discriminates
};

struct ChosenMeasurement {
  int candidate = 0;
  std::string purpose;           // "tells tip_radius from oblique_slip", "learns the values of tip_radius"
  double separation_sigmas = 0;  // as ProposedTouch has it
  int to_verdict =
      0;  // measurements like these until DesignRules::verdict_nats; 0: one model only, or too many
};

// `names` and `predictions`: of the models, best first. `objects[candidate]`: which of `object_count` objects it
// concerns; measurements are spread over them. Empty if none would discriminate.
std::vector<ChosenMeasurement> ChooseMeasurements(const std::vector<std::string>& names,
                                                  const std::vector<LinearisedPrediction>& predictions,
                                                  const std::vector<int>& objects, int object_count,
                                                  const ChoiceRules& rules);

}  // namespace touchstone::diagnosis::design
