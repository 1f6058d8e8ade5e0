// Whether repeats scatter as if the object, or the tool, lay elsewhere at every touch, or the arm had another speed: play, a
// loose mount. Such a scatter grows on slopes and differs between fingers, and is neither of the two noises.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/touches/noise/noise_kinds.h"
#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::selection {

struct PoseScatter {
  double size = 0;       // standard deviation: m, rad, or a share of the speed
  double gain_nats = 0;  // over noise that is the same for all fingers (BIC)
  bool ahead = false;    // of noise of the fingers; false: the two explain the scatter about as well
  std::string words;     // sentences for people
};

// `residuals` [k * fingers + i] of the best model, with `details` of it; `noise`: found in the same residuals. Nothing where
// that noise explains more, or repeats are few.
std::optional<PoseScatter> FindPoseScatter(const touches::Observations& observations,
                                           const touches::Prediction& details,
                                           const std::vector<double>& residuals,
                                           const touches::NoiseFindings& noise);

}  // namespace touchstone::diagnosis::selection
