// What forbids to assert the steps of a ladder: values at their bounds, many effects of sizes that no rig shows, a rest
// that nothing explains.
#pragma once

#include <string>

#include "server/diagnosis/selection/ladder.h"

namespace touchstone::diagnosis::selection {

struct Doubts {
  bool at_bound = false;      // a value is at the bound of its effect: the data ask for more
  bool many_strange = false;  // more than three effects at once, none near the size that rigs show
  bool remounted = false;     // the object lay elsewhere in every round: repeats differ by more than noise
  std::string words;          // a sentence for people; empty if there is no doubt

  bool any() const { return at_bound || many_strange || remounted; }
};

// Of the steps that the ladder has so far; those at a bound say so in their words.
Doubts DoubtsOf(const engine::Fit& fit, const std::vector<engine::SelectedStep>& steps, Ladder* ladder);

// Says of steps that they would need more than rigs show, and is less sure of them.
void DoubtUnusualValues(const engine::Fit& fit, const std::vector<engine::SelectedStep>& steps,
                        Ladder* ladder);

}  // namespace touchstone::diagnosis::selection
