// The table of right, honest and confidently wrong, arm by arm, and the lines over all of them.
#pragma once

#include <string>

#include "tests/hidden_effects/score/trial.h"

namespace touchstone::hidden {

// Markdown.
std::string FiguresTable(const TrialResult& result);

}  // namespace touchstone::hidden
