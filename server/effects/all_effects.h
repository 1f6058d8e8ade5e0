// The list of every built-in touch effect. A new effect is one file, its test, and one line in
// all_effects.cpp.
#pragma once

#include "server/model/effect.h"

namespace touchstone::effects {

// The catalogue that model files are read with: the built-in effects, and formulas. Made at the first call,
// never changed; any thread may use it.
const model::EffectCatalogue& Catalogue();

// The one effect of the catalogue with this role; not for kSystematic, of which there are many.
std::shared_ptr<const model::Effect> FindByRole(model::EffectRole role);

}  // namespace touchstone::effects
