// Data errors first: before any physics is fitted, a list of discrete mistakes in the file is tried, each with the model
// as it is. A search for effects takes minutes on a file with two columns exchanged, and ends with four to seven
// effects at their bounds, all of them nonsense.
//
// A mistake is claimed only where it must be one (numbers: rules.h):
// - its fix leaves at most max_ratio of the error, on the same touches and with the same model. What it competes with
//   is physics that is missing; no fix has a size to adapt (but object origins, see there), so that physics would have
//   to equal the mistake in every direction at once to be mistaken for it.
//   24 rigs of strong physics (tests beside this file), six seeds each, made no claim, nor did any public set
//   without a mistake;
// - what is left is small against what was measured (max_left): the fix explains the data rather than that the
//   data shrank, as times do that are divided by 1000;
// - the misfit is a length that counts (min_misfit_m), and another kind of mistake does not do nearly as well;
// - a factor of speeds or times is the discrete one, within scale_tolerance: a slowdown of 0.45 is physics, speeds
//   doubled are not.
// Mistakes that make the same file of this object (lateral reversed; outer fingers exchanged) are all named.
#pragma once

#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/input.h"

namespace touchstone::diagnosis::checks {

// The mistakes that explain the misfit, most telling first; empty: none does, or there are too few touches to say.
// Never fails because of the data: what contradicts itself is left to the diagnosis that follows. CANCELLED as there.
absl::StatusOr<std::vector<engine::DataProblem>> FindDataProblems(const DiagnosisInput& input,
                                                                  const DiagnosisContext& context);

// A round at another speed than the file says (round_speed.h). Physics that acts in one round only may look like it, so it is
// asked for once the model's effects have had their turn.
std::vector<engine::DataProblem> FindRoundAtAnotherSpeed(const DiagnosisInput& input, ThreadPool* pool);

// The mistakes in rows that a fit has set aside: those that explain these rows alone, the others being right.
std::vector<engine::DataProblem> FindProblemsOfRows(const DiagnosisInput& input, const std::vector<int>& rows,
                                                    ThreadPool* pool);

}  // namespace touchstone::diagnosis::checks
