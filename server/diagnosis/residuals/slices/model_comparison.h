// Two models on the same touches: which errs less, where, and which touches decide.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/diagnosis/residuals/slices/slices.h"
#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::residuals {

// A touch that one model predicts better than another.
struct DecidingTouch {
  uint64_t touch = 0;  // its number in the measurement file
  std::string object;
  double fall = 0;  // of the touch's sum of squared residuals, over the noise's square; < 0: it rises
  int finger = 0;   // that holds most of it
  double before_s = 0, after_s = 0;  // its residuals
};

// At most `count` touches with the largest fall (`rises`: the largest rise), the largest first; those without any are left
// out. residuals: [k * fingers + finger], s, NaN where a finger takes no part under either.
std::vector<DecidingTouch> FindDecidingTouches(const touches::Observations& observations,
                                               const std::vector<double>& before,
                                               const std::vector<double>& after, double sigma_s, size_t count,
                                               bool rises);

struct ModelDifference {
  double rmse_s = 0, other_rmse_s = 0;                // over the readings that both models expect
  double difference_s = 0, lower_s = 0, upper_s = 0;  // of the other's RMSE less the first's; 95 % interval
  double other_better = 0;                            // share of the bootstrap's draws, 0 to 1
  std::vector<ErrorSlice> better, worse;              // parts in which the other errs less, and more
  std::vector<DecidingTouch> deciding;                // largest change first, whichever way
};

// The interval is a percentile bootstrap over poses (1000 draws from `seed`): repeats of one pose share its error. Empty
// where fewer than two poses are compared.
ModelDifference CompareModels(const touches::Observations& observations, const touches::Prediction& first,
                              const touches::Prediction& other, double sigma_s, uint64_t seed);

}  // namespace touchstone::diagnosis::residuals
