// Touches of several objects as one session, in requests of one object each.
#pragma once

#include <vector>

#include "client/source/dataset/measurement_csv.h"
#include "touchstone/v1/source.pb.h"

namespace touchstone::client {

// The touches of `session` from `first` on that are of one object, at most `max_touches`: object, touches, the index of the first
// and the touches before it that act on it. Model, seed and whatever else are the caller's. `first` < session.size().
v1::TouchRequest PartOfSession(const std::vector<MeasuredTouch>& session, size_t first, size_t max_touches);

}  // namespace touchstone::client
