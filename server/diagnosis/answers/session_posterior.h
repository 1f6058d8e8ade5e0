// How much the values of a model scatter between sessions, beside what one session leaves open.
#pragma once

#include "server/diagnosis/joint/session_changes.h"
#include "server/uncertainty/posterior.h"

namespace touchstone::diagnosis {

// Of the last session's model: gives each value that three sessions or more have estimated its scatter
// between them (OpenValue::between_sessions).
void AddBetweenSessions(const std::vector<joint::ComparedEffect>& effects, uncertainty::Posterior* posterior);

}  // namespace touchstone::diagnosis
