// What several sessions show together, as the report has it.
#pragma once

#include <string>

#include "server/diagnosis/report/diagnosis.h"

namespace touchstone::diagnosis::report {

// `last`: what the session whose values the step has is called.
Step StepOfSessions(const joint::SessionStep& found, const joint::SessionChanges& changes,
                    const std::string& last);

}  // namespace touchstone::diagnosis::report
