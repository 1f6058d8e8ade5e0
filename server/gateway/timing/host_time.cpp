#include "server/gateway/timing/host_time.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <vector>

#include "server/base/status.h"
#include "server/gateway/timing/paced_clock.h"

namespace touchstone::gateway::timing {
namespace {

constexpr std::chrono::microseconds kLookAgain{200};

double SteadyNowS() {
  return SteadyClock().NowS();
}

// What HostNowS follows. It stays: a thread may be reading it.
struct Followed {
  explicit Followed(std::shared_ptr<const PacedClock> the_clock) : clock(std::move(the_clock)) {}
  const std::shared_ptr<const PacedClock> clock;
  std::atomic<double> newest_s{0};

  double NowS() {
    const double steady_s = SteadyNowS();
    const PacedClock::Course course = clock->Get();
    const double alone_s = std::max(0.0, steady_s - course.StandsFromS() - kEmulatorGoneS);
    const double now_s = course.began_s + course.SinceS(steady_s) + alone_s;
    // It never goes back, also when the emulator goes on after all.
    double newest = newest_s.load(std::memory_order_relaxed);
    while (newest < now_s && !newest_s.compare_exchange_weak(newest, now_s)) continue;
    return std::max(newest, now_s);
  }
};
std::atomic<Followed*> followed{nullptr};

class Host final : public Clock {
 public:
  Time Now() const override {
    return Time(std::chrono::duration_cast<Duration>(std::chrono::duration<double>(HostNowS())));
  }
  double UnixNowS() const override { return SteadyClock().UnixNowS(); }

 private:
  void WaitOnce(std::unique_lock<std::mutex>& lock, std::condition_variable& changed,
                Time until) const override {
    // A clock that stands just before `until` is not asked all the time.
    changed.wait_for(
        lock, std::max<Duration>(until - Now(), followed.load() == nullptr ? Duration(0) : kLookAgain));
  }
};

}  // namespace

const Clock& HostClock() {
  static const Host clock;
  return clock;
}

double HostNowS() {
  Followed* const clock = followed.load(std::memory_order_acquire);
  return clock == nullptr ? SteadyNowS() : clock->NowS();
}

double HostLagS() {
  return SteadyNowS() - HostNowS();
}

double UnixNowS() {
  return SteadyClock().UnixNowS();
}

absl::Status FollowClock(const std::string& file) {
  static std::mutex mutex;
  static auto* const all = new std::vector<std::unique_ptr<Followed>>;
  if (file.empty()) {
    followed = nullptr;
    return absl::OkStatus();
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(std::shared_ptr<const PacedClock> clock, OpenPacedClock(file));
  const std::lock_guard<std::mutex> lock(mutex);
  all->push_back(std::make_unique<Followed>(std::move(clock)));
  followed = all->back().get();
  return absl::OkStatus();
}

}  // namespace touchstone::gateway::timing
