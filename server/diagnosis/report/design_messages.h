// Proposed touches as parts of the wire message.
#pragma once

#include "server/diagnosis/design/propose.h"
#include "touchstone/v1/diagnosis.pb.h"

namespace touchstone::diagnosis::report {

// Appends to next_touches.
void WriteProposedTouch(const design::ProposedTouch& proposed, v1::Report* report);

}  // namespace touchstone::diagnosis::report
