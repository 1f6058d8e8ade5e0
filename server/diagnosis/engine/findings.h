// What one kind of measurement by itself is found to lack, from its rows alone: the whole way from an explanation to a
// verdict. Kinds with hypotheses, noise or words of their own build on its parts (ladder/ladder.h).
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/engine/ladder/ladder.h"
#include "server/diagnosis/engine/modality.h"

namespace touchstone::diagnosis::engine {

struct Findings : Improvement {
  Quality initial, final;  // of the given and of the improved model
};

// `noise`: standard deviation of the modality's errors, in its unit, that no model can go below. Errors as FitModel and as
// the modality's.
absl::StatusOr<Findings> FindMissing(const Modality& modality, double noise);

// Whether a misfit is left that the noise does not bring about.
bool StructureRemains(const Quality& quality, double noise);

}  // namespace touchstone::diagnosis::engine
