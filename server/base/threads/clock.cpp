#include "server/base/threads/clock.h"

#include <algorithm>

namespace touchstone {
namespace {

class Steady final : public Clock {
 public:
  Time Now() const override { return std::chrono::steady_clock::now(); }
  double UnixNowS() const override {
    return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  }

 private:
  void WaitOnce(std::unique_lock<std::mutex>& lock, std::condition_variable& changed,
                Time until) const override {
    changed.wait_until(lock, until);
  }
};

}  // namespace

double Clock::NowS() const {
  return std::chrono::duration<double>(Now().time_since_epoch()).count();
}

double Clock::SecondsSince(Time begin) const {
  return std::chrono::duration<double>(Now() - begin).count();
}

Clock::Time Clock::In(double seconds) const {
  return Now() + std::chrono::duration_cast<Duration>(
                     std::chrono::duration<double>(std::clamp(seconds, -kLongestS, kLongestS)));
}

void Clock::SleepFor(double seconds) const {
  std::mutex mutex;
  std::condition_variable never;
  std::unique_lock<std::mutex> lock(mutex);
  WaitFor(lock, never, seconds, [] { return false; });
}

const Clock& SteadyClock() {
  static const Steady clock;
  return clock;
}

}  // namespace touchstone
