// The clocks of this host.
#pragma once

#include <string>

#include <absl/status/status.h>

#include "server/base/threads/clock.h"

namespace touchstone::gateway::timing {

// Seconds of the steady clock: the time base of everything in the gateway. In front of an emulated rig it is the rig's
// clock instead (paced_clock.h), which stands still while the emulator waits for the processor.
double HostNowS();
// Seconds since 1970 (UTC), for records; it may step.
double UnixNowS();
// HostNowS as a clock to wait by: the default of everything in the gateway that waits.
const Clock& HostClock();
// By how much HostNowS is behind the steady clock.
double HostLagS();

// From now on HostNowS is the clock that an emulator keeps in this file; empty: the steady clock. To be called before
// anything is connected. An emulator that is gone, or stopped for more than kEmulatorGoneS, holds up no limit of time:
// from then on the clock goes on by itself.
constexpr double kEmulatorGoneS = 3;
absl::Status FollowClock(const std::string& file);

}  // namespace touchstone::gateway::timing
