// Whether every round of a set has a pose of the object of its own: an object that was put down anew between rounds. What
// repeats differ by is then no noise (reproducibility against repeatability). Pure functions.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::selection {

struct RoundStructure {
  double p = 1;          // of so much agreement within rounds if there were none (F test, permutations)
  double sigma_s = 0;    // of repeats, less what a pose per object and round explains; 0: not tested
  double gain_nats = 0;  // of a pose per object and round over none (BIC)
  double translation_m =
      0;  // root mean square of a round's translation about the mean of all, along one axis
};

// `details` and `residuals` [k * fingers + i] of one model. Not tested: fewer than two rounds, or more than 40.
RoundStructure FindRoundStructure(const touches::Observations& observations,
                                  const touches::Prediction& details, const std::vector<double>& residuals);

// Whether it is neither chance nor negligible beside a floor of `sigma_s`.
bool SharesRounds(const RoundStructure& rounds, double sigma_s);

// A sentence for people.
std::string RoundsInWords(const RoundStructure& rounds, double sigma_s);

// Puts the round in front of the covariates.
void NameRoundFirst(const RoundStructure& rounds, engine::UnexplainedRest* rest);

}  // namespace touchstone::diagnosis::selection
