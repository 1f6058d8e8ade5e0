// What a session of a journal measured, without a file between.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/session/journal/journal.h"
#include "server/session/measurements/measurement_csv.h"
#include "server/session/measurements/measurement_set.h"

namespace touchstone::session {

// The touches that are done, in the order of their approaches, times since each approach began. `touch` is
// the client's id where every id is a number of its own, else the number in the session; session_time_s is
// the measured one where it is known. DATA_LOSS names a touch whose command cannot be read.
absl::StatusOr<std::vector<MeasuredTouch>> SessionMeasurements(const Journal& journal,
                                                               const std::string& session);

// The same of touches that are all done; `emulated`: of their session, becomes the column of emulated.h; `where` begins an
// error.
absl::StatusOr<std::vector<MeasuredTouch>> MeasuredTouchesOf(const std::vector<JournalTouch>& done,
                                                             bool emulated, const std::string& where);

// The set that ParseMeasurementSet reads from FormatMeasurements(touches), bit for bit, and refused where it would
// be. At least one touch, all with the same number of times, at least one. `origin` is what messages call it.
absl::StatusOr<MeasurementSet> MakeMeasurementSet(const std::vector<MeasuredTouch>& touches,
                                                  const std::string& origin);

// Both.
absl::StatusOr<MeasurementSet> SessionMeasurementSet(const Journal& journal, const std::string& session,
                                                     const std::string& origin);

}  // namespace touchstone::session
