// For tests of effects: a batch with something in every field, and a way to apply an effect by name.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "server/effects/touch_batch.h"
#include "server/model/effect.h"

namespace touchstone::effects {

// A cube with edges of 100 mm about the origin, named "cube"; the same surface at every call.
std::shared_ptr<const geometry::Surface> TestCube();

// Touches with all fields filled, as every stage would find them: random but plausible numbers that depend on
// `seed` alone, some fingers without contact (travel, times and contact NaN) unless `all_hit`.
TouchBatch TestBatch(int size, int fingers, uint64_t seed = 1, bool all_hit = true);

// Values in the unit of files, by parameter; what is not named is neutral.
using FileValues = std::vector<std::pair<std::string, std::vector<double>>>;

// Applies an effect of the catalogue; values must be within bounds.
void ApplyByName(const std::string& effect, const FileValues& values, TouchBatch* touches);
void ApplyEffect(const model::Effect& effect, const FileValues& values, TouchBatch* touches);

// The names of the fields in which two batches differ; NaN equals NaN.
std::vector<std::string> ChangedFields(const TouchBatch& before, const TouchBatch& after);

}  // namespace touchstone::effects
