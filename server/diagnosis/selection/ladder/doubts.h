// What forbids to assert the steps of a ladder: values at their bounds, many effects of sizes that no rig shows, a rest
// that nothing explains.
#pragma once

#include <string>

#include "server/diagnosis/selection/ladder/ladder.h"

namespace touchstone::diagnosis::selection {

// Of the steps that the ladder has so far, a sentence for people where values end at their bounds, which their words say too,
// or where more than three effects are needed at once and none is near the size that rigs show; empty: neither.
std::string StrangeValuesInWords(const engine::Fit& fit, const std::vector<engine::SelectedStep>& steps,
                                 Ladder* ladder);

// Says of steps that they would need more than rigs show, and is less sure of them.
void DoubtUnusualValues(const engine::Fit& fit, const std::vector<engine::SelectedStep>& steps,
                        Ladder* ladder);

// The same of two effects that two speeds cannot tell from a third dependence on the speed. `fit`: on the touches of the
// search.
void DoubtTwoSpeeds(const Workspace& workspace, const engine::Fit& fit,
                    const std::vector<engine::SelectedStep>& steps, Ladder* ladder);

// Beside a rest that may be an error of each pose: doubts effects whose values would differ from none by chance if the poses were
// drawn again, since a few poses with large errors carry them. `fit`: on the touches of the search.
void DoubtCarriedByFewPoses(const Workspace& workspace, const engine::Fit& fit,
                            const std::vector<engine::SelectedStep>& steps, Ladder* ladder);

}  // namespace touchstone::diagnosis::selection
