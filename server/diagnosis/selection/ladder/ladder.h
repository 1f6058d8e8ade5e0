// From a selected explanation to the ladder: the error after each step, refits, what remains, the improved model.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/engine/ladder/ladder.h"
#include "server/diagnosis/engine/search/set_aside.h"
#include "server/diagnosis/selection/quality.h"
#include "server/diagnosis/selection/selection.h"
#include "server/uncertainty/posterior.h"

namespace touchstone::diagnosis::selection {

struct Ladder : engine::Improvement {
  engine::NoiseFloor noise_floor;
  std::string dropouts;              // where contacts are missed, for people; empty: nowhere in particular
  engine::Quality final;             // after all steps and refits
  engine::SetAside set_aside;        // outliers
  bool surface_as_given = false;     // the model says that surfaces are as wrong as they are
  std::vector<double> residuals;     // of the improved model, all touches, s
  touches::Prediction prediction;    // of the improved model, with details
  uncertainty::Posterior posterior;  // of the improved model
};

// Takes steps out of the selection with which the error, as a comparison finds it, does not fall.
absl::StatusOr<Ladder> BuildLadder(const Workspace& workspace, SelectionResult* selection);

// Its parts.

// The kind of noise: steps where the model has none of it, refits where its values are others. Needs the ladder's
// noise floor and final errors, which noise does not change. Where the noise is `correlated`, or repeats share a course in
// time, only its level, ticks and dropouts are judged: correlated noise by itself makes fingers differ and tails heavy.
void AddNoiseSteps(touches::NoiseFindings noise, bool correlated, Ladder* ladder);

// Correlated noise of the fingers, as a step, or as a refit where the residuals rule the model's own values out.
void AddMemoryStep(const NoiseMemory& memory, const touches::Observations& observations, Ladder* ladder);

// Takes correlated noise out of the improved model that the given one has and the residuals rule out.
void RemoveAbsentMemory(const touches::Observations& observations, Ladder* ladder);

// What depends on which covariate where no named effect explains it, and a formula or a curve, if one was found with which the
// error falls. Of `ladder` the improved model, its errors and the noise floor; `with`: the improved model with the formula in
// its place; nothing: there is none to suggest.
absl::StatusOr<engine::UnexplainedRest> DescribeUnexplained(const Workspace& workspace,
                                                            const SelectionResult& selection,
                                                            const Ladder& ladder,
                                                            std::optional<model::Model> with);

}  // namespace touchstone::diagnosis::selection
