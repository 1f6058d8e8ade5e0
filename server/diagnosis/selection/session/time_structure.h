// Whether what repeats differ by has a course in time: such differences are not noise. Pure functions of observations
// and residuals, in the order of the session.
#pragma once

#include <vector>

#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::selection {

struct TimeStructure {
  // Lag-1 autocorrelation of pose-centred residuals, less its mean and over its spread when touches change places
  // within their poses. z > 4 does not happen by chance.
  double z = 0;
  double p = 1;                        // one-sided
  std::vector<double> finger_z;        // of each finger alone
  double sigma_s = 0;                  // von Neumann: from differences of neighbours in time; 0: no repeats
  std::vector<double> finger_sigma_s;  // of each finger's residual
  int neighbours = 0;
};

// `residuals` [k * fingers + i], of touches::Residuals.
TimeStructure FindTimeStructure(const touches::Observations& observations,
                                const std::vector<double>& residuals);

// The floor's figures on time.
void AddTimeStructure(const touches::Observations& observations, const std::vector<double>& residuals,
                      engine::NoiseFloor* floor);

// Whether the floor holds a course in time that is neither chance nor negligible.
bool SharesTime(const engine::NoiseFloor& floor);

// Puts the place in the session in front of the covariates.
void NameTimeFirst(const touches::Observations& observations, const engine::NoiseFloor& floor,
                   engine::UnexplainedRest* rest);

}  // namespace touchstone::diagnosis::selection
