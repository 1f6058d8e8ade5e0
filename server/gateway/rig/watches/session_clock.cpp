#include "server/gateway/rig/watches/session_clock.h"

#include <time.h>

#include <cmath>
#include <fstream>

#include "server/base/numbers/nan.h"
#include "server/base/status.h"
#include "server/gateway/timing/host_time.h"

namespace touchstone::gateway {
namespace {

constexpr double kMaxGapS = 31 * 86400.0;

// Host seconds that have passed since the session's last touch, after a boot.
double PassedS(const HostClocks& now, double last_unix_s, bool booted_since) {
  const double certain_s = booted_since ? now.boot_s : 0;
  const double by_wall_clock_s = now.unix_s - last_unix_s;
  return by_wall_clock_s >= certain_s && by_wall_clock_s <= kMaxGapS ? by_wall_clock_s : certain_s;
}

}  // namespace

HostClocks ReadHostClocks() {
  HostClocks clocks;
  std::getline(std::ifstream("/proc/sys/kernel/random/boot_id"), clocks.boot_id);
  timespec boot{};
  clock_gettime(CLOCK_BOOTTIME, &boot);
  clocks.boot_s =
      static_cast<double>(boot.tv_sec) + 1e-9 * static_cast<double>(boot.tv_nsec) - timing::HostLagS();
  clocks.unix_s = timing::UnixNowS();
  return clocks;
}

absl::StatusOr<double> SessionClock::NowS(const std::string& session) {
  const HostClocks now = clocks_();
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::JournalClock clock, journal_->SessionClock(session));
  const bool has_clock = !clock.boot_id.empty() && std::isfinite(clock.origin_s);
  if (has_clock && clock.boot_id == now.boot_id && now.boot_s >= clock.origin_s)
    return (now.boot_s - clock.origin_s) * time_scale_;
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<session::JournalTouch> last, journal_->LastDone(session));
  // The last that is known of the session, a touch or a photograph; once a boot, so that reading the pictures along does
  // not matter.
  double last_s = 0, last_unix_s = kNaN;
  bool known = last.has_value();
  if (known) {
    if (std::isfinite(last->result.session_time_s)) last_s = last->result.session_time_s;
    last_unix_s = last->result.start_unix_s;
  }
  const absl::Status read = journal_->ForEachImage(session, [&](const session::JournalImage& image) {
    if (image.view && image.view->session_time_s >= last_s)
      last_s = image.view->session_time_s, last_unix_s = image.unix_s, known = true;
    return true;
  });
  // A damaged picture keeps nobody from touching.
  if (!read.ok() && !absl::IsDataLoss(read)) return read;
  double session_s = last_s;
  if (known) session_s += PassedS(now, last_unix_s, has_clock) * time_scale_;
  TOUCHSTONE_RETURN_IF_ERROR(
      journal_->SetSessionClock(session, {now.boot_id, now.boot_s - session_s / time_scale_}));
  return session_s;
}

}  // namespace touchstone::gateway
