#include <algorithm>
#include <chrono>
#include <thread>

#include "tests/rig/world.h"

namespace touchstone::rig {
namespace {

double HostS() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

constexpr double kPollHostS = 2e-4;

}  // namespace

SimClock::SimClock(double speedup) : speedup_(speedup), began_host_s_(HostS()) {}

double SimClock::NowS() const {
  return (HostS() - began_host_s_) * speedup_;
}

void SimClock::SleepUntil(double sim_s, const std::function<bool()>& wake) const {
  for (;;) {
    if (wake && wake()) return;
    const double left_host_s = (sim_s - NowS()) / speedup_;
    if (left_host_s <= 0) return;
    // Long waits sleep in slices too: 3600 s at a time keeps the duration representable for any `sim_s`.
    const double slice_s = std::min(left_host_s, wake ? kPollHostS : 3600.0);
    std::this_thread::sleep_for(std::chrono::duration<double>(slice_s));
  }
}

}  // namespace touchstone::rig
