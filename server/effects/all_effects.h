// The list of every built-in effect. A new effect is one file, its test, and one line in
// all_effects.cpp.
#pragma once

#include <memory>
#include <vector>

#include "server/model/effect.h"

namespace touchstone::effects {

// The catalogue that model files are read with: the built-in effects, and formulas. Made at the first call,
// never changed; any thread may use it.
const model::EffectCatalogue& Catalogue();

// Those of the catalogue that act on touches (formulas and lookups among them), and on photographs.
const std::vector<std::shared_ptr<const model::Effect>>& TouchEffects();
const std::vector<std::shared_ptr<const model::Effect>>& PhotoEffects();

// The one effect of the catalogue with this role; not for kSystematic, of which there are many.
std::shared_ptr<const model::Effect> FindByRole(model::EffectRole role);

}  // namespace touchstone::effects
