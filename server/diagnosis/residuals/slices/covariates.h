// What a residual may depend on, in the words and units that people use: one list for slices and for curves.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::residuals {

struct ResidualCovariate {
  std::string name;                 // as formulas and reports name it: "incidence_deg"
  std::string words;                // as a sentence names it: "incidence"
  std::string unit;                 // "deg"; empty for a ratio or a category
  std::vector<std::string> labels;  // of a category; its values are indices into these
  // Of finger i in touch k; NaN where it is not known.
  std::function<double(int k, int finger)> value;

  bool is_category() const { return !labels.empty(); }
};

// Every covariate that the set and the prediction have values for, without those that never vary. Both must
// outlive the list.
std::vector<ResidualCovariate> ListResidualCovariates(const touches::Observations& observations,
                                                      const touches::Prediction& prediction);

// At most about `limit` of the touches that take part (used, with a residual), in order: whole poses, the
// same ones at every call.
std::vector<int> ThinnedTouches(const touches::Observations& observations,
                                const std::vector<double>& residuals, int limit);

// The number of fingers of touch k that have a residual.
int FingersCompared(const touches::Observations& observations, const std::vector<double>& residuals, int k);

// What noise of sigma_s contributes on average to the square of one finger's residual (s^2), in a touch with
// that many compared fingers: removing the touch's mean takes away one part in n.
inline double NoiseShare(double sigma_s, int fingers_compared) {
  return sigma_s * sigma_s * (1 - 1.0 / fingers_compared);
}

}  // namespace touchstone::diagnosis::residuals
