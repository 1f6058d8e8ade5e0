// The arms of the trial: what is hidden in each, drawn from the seed of the set.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tests/hidden_effects/score/test_objects.h"

namespace touchstone::hidden {

enum class Kind {
  kNothing,            // at most surface bumps
  kEffects,            // one or more of the catalogue
  kIndistinguishable,  // one of the catalogue that these data cannot distinguish from others
  kUnlisted,           // physics that the catalogue lacks
  kNoPoses,            // only objects and times
  kWrongValue,         // a value of the model's own
  kNoiseMissing,       // an ideal model against measurements with noise
};

struct Arm {
  std::string name;
  Kind kind = Kind::kNothing;
  int sets = 0;  // at --share 1
  std::function<Scenario(const TestObjects&, uint64_t seed)> draw;
  // Effects that may be named besides the truth: what lost contacts and outliers resemble.
  std::vector<std::string> tolerated;
};

// In the order of the table.
const std::vector<Arm>& Arms();
const Arm* FindArm(const std::string& name);

enum class Seeds { kTuning, kHeldOut };

// The seed of set k of an arm: ranges of tuning and held-out seeds share no number.
uint64_t SeedOf(Seeds seeds, const Arm& arm, int k);

// Effects that fit alike whatever is touched at one speed (or at any speed). Of `truth` with these values, in
// this scenario; without truth itself.
std::vector<std::string> EquivalentEffects(const Hidden& truth, const Scenario& scenario);

}  // namespace touchstone::hidden
