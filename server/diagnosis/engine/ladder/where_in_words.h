// Where an effect acts, for people, if not everywhere alike.
#pragma once

#include <string>

#include "server/diagnosis/engine/competition/competition.h"

namespace touchstone::diagnosis::engine {

// "Acts on lat10 only.", "Acts on finger m only: the others agree.", with the places that these data cannot tell from it;
// empty: it acts everywhere alike. `fit`: what the step is a part of.
std::string WhereInWords(const Fit& fit, const SelectedStep& step);

}  // namespace touchstone::diagnosis::engine
