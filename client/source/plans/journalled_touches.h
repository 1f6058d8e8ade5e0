// Which touches of a plan a physical source has made before: it gives those from its journal, without motion.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "client/source/connection/connection.h"
#include "client/source/dataset/measurement_csv.h"

namespace touchstone::client {

// One entry per touch of the plan: whether the source's session has it. Touches of a session are told by object and command; of
// repeats of one pose the first ones of the plan are taken for those that are there, since that is the order in which a plan is
// made. A session that the source does not have has none.
absl::StatusOr<std::vector<bool>> TouchesInJournal(Connection* connection, const std::string& session,
                                                   const std::vector<MeasuredTouch>& plan);

}  // namespace touchstone::client
