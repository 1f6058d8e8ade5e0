// The arm's states during a touch as the journal and files keep them.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "server/session/journal/journal.h"
#include "touchstone/v1/types.pb.h"

namespace touchstone::session {

// How the journal names the encoding: the serialised message.
inline constexpr char kSeriesEncoding[] = "touchstone.v1.TouchSeries";

// DATA_LOSS, beginning with `where`, for another encoding, and for arrays of lengths that do not fit together.
absl::StatusOr<v1::TouchSeries> ParseSeries(const JournalSeries& series, const std::string& where);

}  // namespace touchstone::session
