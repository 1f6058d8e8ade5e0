// What reports and files of other parts call an effect of a model and an entry of a parameter.
#pragma once

#include <string>

#include "server/model/effect.h"

namespace touchstone::model {

// "tip_radius", or "formula lead_screw".
std::string NameOf(const Effect& effect);

// "l", "x", or empty: which entry of a parameter.
std::string EntryName(const ParameterInfo& parameter, int entry, int fingers);

}  // namespace touchstone::model
