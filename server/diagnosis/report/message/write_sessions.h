// Several sessions as a message.
#pragma once

#include "server/diagnosis/report/diagnosis.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis::report {

// All but the models.
void WriteSessions(const Sessions& sessions, v1::SessionComparison* message);

}  // namespace touchstone::diagnosis::report
