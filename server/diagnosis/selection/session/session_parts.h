// The parts of a session in which something may have been other than in the rest: rounds, and stretches of touches.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/touches/observations.h"

namespace touchstone::diagnosis::selection {

struct SessionPart {
  std::string words;      // for people: "in round 2", "from touch 480 to touch 719"
  std::vector<char> has;  // [k]; at most a half of the touches
  bool of_rounds = false;
};

// Of the touches that are used: each set of rounds where they are few, else each round, what came up to and after each, and
// every other round; then what lies between any two twentieths of the session.
std::vector<SessionPart> ListSessionParts(const touches::Observations& observations);

}  // namespace touchstone::diagnosis::selection
