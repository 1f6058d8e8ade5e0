// The search for shared effects, on two sides that are prepared.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/diagnosis/joint/side.h"

namespace touchstone::diagnosis::joint {

// Shared effects in some form, with the best that each kind shows beside them.
struct JointExplanation {
  std::vector<SharedEffect> shared;  // at the joint values
  std::vector<OwnEffects> own;       // by kind
  JointFit fit;
};

struct SharedSelection {
  JointExplanation best;
  JointExplanation none;                // without any shared effect
  std::vector<JointExplanation> tried;  // every other form
};

// Effects of one kind alone that the one has and the other does not.
std::vector<std::string> OwnBeside(const JointExplanation& one, const JointExplanation& other);

using Sides = std::vector<Side>;

// `enter` is told which effect is tried and how much of the search is done, 0 to 1; its error ends the search. How many effects
// will be found is not known: each that is found halves what is left.
absl::StatusOr<SharedSelection> SearchShared(
    const Sides& sides, const std::function<absl::Status(const std::string& tried, double done)>& enter);

std::vector<Part> PartsOf(const Sides& sides, const JointExplanation& explained);

}  // namespace touchstone::diagnosis::joint
