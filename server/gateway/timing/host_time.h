// The clocks of this host.
#pragma once

namespace touchstone::gateway::timing {

// Seconds of the steady clock: the time base of everything in the gateway.
double HostNowS();
// Seconds since 1970 (UTC), for records; it may step.
double UnixNowS();

}  // namespace touchstone::gateway::timing
