// Effects that a user writes in the model file (server/model/model_file.md), and what an expression may use.
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>
#include <absl/types/span.h>

#include "server/effects/touch_batch.h"
#include "server/model/effect.h"

namespace touchstone::effects {

// One variable of expressions, in the unit of files. `cov_*` columns are variables too and not listed.
struct FormulaVariable {
  const char* name;
  const char* unit;    // "mm", "deg", ...; empty: a plain number
  model::Stage since;  // the first stage that knows it
  const char* meaning;
  double (*read)(const TouchBatch& touches, int finger, int touch);
};
absl::Span<const FormulaVariable> FormulaVariables();

// One function or constant of expressions, for people: "atan2(y, x)".
struct FormulaWord {
  const char* name;
  const char* usage;
  const char* meaning;
};
absl::Span<const FormulaWord> FormulaFunctions();
absl::Span<const FormulaWord> FormulaConstants();

inline constexpr int kMaxFormulaCharacters = 1000;
inline constexpr int kMaxFormulaParameters = 32;

// Checks and compiles a formula. Errors name the formula, the place in the expression and what would be
// right. The effect may be applied by any number of threads at once. Its name is "formula"; spec.name is in
// effect->formula. Its parameters' neutral value is the one that the spec gives.
absl::StatusOr<std::shared_ptr<const model::Effect>> MakeFormulaEffect(const model::FormulaSpec& spec);

}  // namespace touchstone::effects
