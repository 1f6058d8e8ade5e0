// What terms of the formula dictionary are made of: covariates and functions of them, and factors that
// differ from finger to finger.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::selection {

using TermValue = std::function<double(int k, int finger)>;

// A covariate or a function of one, in the units of files.
struct TermFactor {
  std::string covariate;    // "incidence_deg"
  std::string expression;   // "tan(incidence_deg*pi/180)"
  bool differs = false;     // between the fingers of a touch
  double penalty_nats = 0;  // what people would try first costs less
  TermValue value;
};

struct FingerFactor {
  std::string expression;  // empty: 1
  TermValue value;
};

// Both must outlive the lists.
std::vector<TermFactor> ListTermFactors(const touches::Observations& observations,
                                        const touches::Prediction& details);
std::vector<FingerFactor> ListFingerFactors(const touches::Observations& observations,
                                            const touches::Prediction& details);

}  // namespace touchstone::diagnosis::selection
