// One round at another speed than the file says: its times are a factor off, compared with the other rounds of the same poses.
#pragma once

#include <vector>

#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::checks {

struct RoundSpeed {
  int round = -1;     // as the file numbers it, else by how often each pose came before; -1: none stands out
  double factor = 1;  // real speed over the file's
  double std_error = 0;
  std::vector<int> rows;  // of the set, in that round
};

// Needs three rounds: of two nobody can say which one is right. Physics that the model lacks is the same in every round and
// cancels; what changes steadily, or differs between rounds in another way than by a factor, is not claimed.
RoundSpeed FindRoundSpeed(const touches::Observations& observations);

}  // namespace touchstone::diagnosis::checks
