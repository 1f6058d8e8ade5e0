// How much a value scatters from session to session beyond what its standard errors explain, and where the next session's is
// expected: what a control chart shows.
#pragma once

#include <vector>

namespace touchstone::diagnosis::joint {

struct SessionEstimate {
  double value = 0, std_error = 0;  // std_error > 0
};

// The mean of a random-effects model and the standard deviation between sessions, by the moments of DerSimonian and Laird
// (Controlled Clinical Trials 7, 1986, 177-188). 0 and 0 without sessions.
struct BetweenSessions {
  double mean = 0, mean_std_error = 0, std_deviation = 0;
};
BetweenSessions EstimateBetweenSessions(const std::vector<SessionEstimate>& sessions);

// What the other sessions let expect of each, three standard deviations to either side: of the scatter between them, of their
// mean, and of the session's own value. A session outside is no evidence of the others' scatter: the one farthest outside is
// set aside, then the next.
struct ControlLimits {
  double lower = 0, upper = 0;
  bool outside = false;  // the session's value
};
struct ControlChart {
  std::vector<ControlLimits> limits;  // by session; empty: there are too few
  BetweenSessions inside;             // of the sessions that are not outside
};
ControlChart MakeControlChart(const std::vector<SessionEstimate>& sessions);

}  // namespace touchstone::diagnosis::joint
