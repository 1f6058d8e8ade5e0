// The clocks of this host.
#pragma once

#include "server/base/clock.h"

namespace touchstone::gateway::timing {

// Seconds of the steady clock: the time base of everything in the gateway.
double HostNowS();
// Seconds since 1970 (UTC), for records; it may step.
double UnixNowS();
// HostNowS as a clock to wait by: the default of everything in the gateway that waits.
const Clock& HostClock();

}  // namespace touchstone::gateway::timing
