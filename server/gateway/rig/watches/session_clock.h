// The time of a session: rig seconds since its first touch, or the motion to its first photograph, began. It never goes
// back and takes no part in the steps of the wall clock (NTP, a person, summer time):
//  - While a host runs, CLOCK_BOOTTIME counts, which also counts while it sleeps. The journal keeps where the session's
//    time began on it, so that another process of the same boot (by its boot_id) goes on without a step.
//  - After a reboot, or on another host, the time goes on from the last touch that is done or the last photograph, by
//    what the wall clock has gone since then. That is accepted from the time since the boot (so much has certainly
//    passed) up to 31 days; where the wall clock says anything else, only the time since the boot is added.
// The journal's start_unix_s is the wall clock's, as it was.
#pragma once

#include <functional>
#include <string>

#include <absl/status/statusor.h>

#include "server/session/journal/journal.h"

namespace touchstone::gateway {

struct HostClocks {
  std::string boot_id;  // of the kernel; another one after every boot
  double boot_s = 0;    // CLOCK_BOOTTIME, less what an emulated rig's clock is behind
  double unix_s = 0;    // the wall clock
};
HostClocks ReadHostClocks();

class SessionClock {
 public:
  // `time_scale`: rig seconds in one of the host.
  SessionClock(session::Journal* journal, double time_scale,
               std::function<HostClocks()> clocks = ReadHostClocks)
      : journal_(journal), time_scale_(time_scale), clocks_(std::move(clocks)) {}

  // The first call for a session, and the first of a boot, writes to the journal: ask before anything moves.
  absl::StatusOr<double> NowS(const std::string& session);

 private:
  session::Journal* const journal_;
  const double time_scale_;
  const std::function<HostClocks()> clocks_;
};

}  // namespace touchstone::gateway
