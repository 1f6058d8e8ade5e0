#include "server/gateway/timing/host_time.h"

#include <chrono>

namespace touchstone::gateway::timing {
namespace {

class Host final : public Clock {
 public:
  Time Now() const override {
    return Time(std::chrono::duration_cast<Duration>(std::chrono::duration<double>(HostNowS())));
  }
  double UnixNowS() const override { return SteadyClock().UnixNowS(); }

 private:
  void WaitOnce(std::unique_lock<std::mutex>& lock, std::condition_variable& changed,
                Time until) const override {
    changed.wait_for(lock, until - Now());
  }
};

}  // namespace

const Clock& HostClock() {
  static const Host clock;
  return clock;
}

double HostNowS() {
  return SteadyClock().NowS();
}

double UnixNowS() {
  return SteadyClock().UnixNowS();
}

}  // namespace touchstone::gateway::timing
