// What people call an effect of a model: a formula and a lookup by the name that they were given, all others by the catalogue's.
#pragma once

#include <string>

#include "server/model/effect.h"

namespace touchstone::model {

inline const std::string& OwnName(const Effect& effect) {
  return effect.formula ? effect.formula->name : effect.lookup ? effect.lookup->name : effect.name;
}

}  // namespace touchstone::model
