// What a session that is taken into a journal must be, from whatever file it was read.
#pragma once

#include <string>

#include <absl/status/status.h>

#include "server/session/journal/journal.h"

namespace touchstone::session {

// Touches that a measurement file could hold (measurement_checks.h), and further numbers, texts, series and pictures that are
// finite and in range. Errors name `origin`, the touch or picture, and the value.
absl::Status CheckSessionContent(const SessionContent& content, const std::string& origin);

}  // namespace touchstone::session
