// Are the touches that the diagnosis proposes better than random ones? A small set with a weak effect is extended by
// either until the verdict is right and certain.
#pragma once

#include <functional>
#include <string>

#include "tests/hidden_effects/score/arms/arms.h"

namespace touchstone::hidden {

struct Race {
  Scenario truth;
  int designed = 0, random = 0;  // touches that were added until the verdict
  int proposed = 0;              // of the designed, those that were proposed; the others are random
  bool designed_arrived = false, random_arrived = false;  // false: gave up at kMaxAdded
  std::string error;
};

inline constexpr int kAddedAtOnce = 8;
inline constexpr int kMaxAdded = 96;

Race RunRace(const TestObjects& objects, uint64_t seed);

struct Races {
  int races = 0, errors = 0, designed = 0, random = 0;  // sums of added touches
  int designed_gave_up = 0, random_gave_up = 0;
};

Races RunRaces(const TestObjects& objects, Seeds seeds, int count, int threads,
               const std::function<void(const Race&)>& each);

// A line of Markdown for the table.
std::string RacesInWords(const Races& races);

}  // namespace touchstone::hidden
