#include "server/gateway/timing/host_time.h"

#include <chrono>

namespace touchstone::gateway::timing {
namespace {

class Host final : public Clock {
 public:
  Time Now() const override {
    return Time(std::chrono::duration_cast<Duration>(std::chrono::duration<double>(HostNowS())));
  }

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
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

}  // namespace touchstone::gateway::timing
