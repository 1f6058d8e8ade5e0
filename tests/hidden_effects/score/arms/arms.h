// The arms of the trial: what is hidden in each, drawn from the seed of the set.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tests/hidden_effects/score/arms/test_objects.h"

namespace touchstone::hidden {

enum class Kind {
  kNothing,            // at most surface bumps
  kEffects,            // one or more of the catalogue
  kIndistinguishable,  // one of the catalogue that these data cannot distinguish from others
  kUnlisted,           // physics that the catalogue lacks
  kNoPoses,            // only objects and times
  kWrongValue,         // a value of the model's own
  kNoiseMissing,       // an ideal model against measurements with noise
  kCause,              // what the catalogue does not describe as it stands (generator/causes.h)
  kBeyondBound,        // an effect of the catalogue, beyond the bounds of its value
  kBadPrint,           // surface bumps that show
  kOldValue,           // a value of the model's own, which a new effect could stand in for
  kWrongNoise,         // noise in the model that the data do not have
  kDataError,          // a mistake in the file
  kTooFew,             // fewer touches than a verdict needs
};

// Of the arms outside the catalogue. Weak: what a careful look at 960 touches can just see. Strong: nobody can
// overlook it, so a verdict that nothing is missing is wrong.
enum class Strength { kNone, kWeak, kRealistic, kStrong };

struct Arm {
  std::string name;
  Kind kind = Kind::kNothing;
  int sets = 0;  // at --share 1
  std::function<Scenario(const TestObjects&, uint64_t seed)> draw;
  // Effects that may be named besides the truth: what lost contacts and outliers resemble.
  std::vector<std::string> tolerated;
  Strength strength = Strength::kNone;
  bool depends_on_time = false;  // the cause does, and nothing else tells it
  int copies = 0;                // of the fitted model that are simulated and fitted again, per set

  // Whether the catalogue holds the truth as it stands, and the file is what it says.
  bool listed() const { return strength == Strength::kNone && kind != Kind::kUnlisted; }
};

// In the order of the table: the catalogue's, then those of outside_arms.cpp.
const std::vector<Arm>& Arms();
const Arm* FindArm(const std::string& name);

// Arms outside the catalogue, each weak, realistic and strong.
std::vector<Arm> OutsideArms();

enum class Seeds { kTuning, kHeldOut };

// The seed of set k of an arm: ranges of tuning and held-out seeds share no number.
uint64_t SeedOf(Seeds seeds, const Arm& arm, int k);

// Effects that fit alike whatever is touched at one speed (or at any speed). Of `truth` with these values, in
// this scenario; without truth itself.
std::vector<std::string> EquivalentEffects(const Hidden& truth, const Scenario& scenario);

}  // namespace touchstone::hidden
