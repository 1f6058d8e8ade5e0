// Whether a part of the touches differs from the others by one offset of the fingers, at random: a finger that catches in
// three touches of ten. Its mean looks like a length of the finger and its scatter like noise, and it is neither.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::selection {

struct PartialOffset {
  double share = 0;              // of the touches that have it, at most a half
  std::vector<double> offset_s;  // of each finger, over the other touches; sum 0
  double gain_nats = 0;          // over noise of any tails round one mean (BIC)
  std::string words;             // a sentence for people
};

// Two groups of touches by maximum likelihood (EM over complete touches), against one Gaussian and one Student
// distribution. `residuals` [k * fingers + i]. Nothing where one distribution says the same, and where the place in the
// session or the pose says which touches have it: these have other names.
std::optional<PartialOffset> FindPartialOffset(const touches::Observations& observations,
                                               const std::vector<double>& residuals);

}  // namespace touchstone::diagnosis::selection
