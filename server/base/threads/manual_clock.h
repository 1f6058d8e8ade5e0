// A clock that stands still until a test moves it. A test tool.
#pragma once

#include <algorithm>
#include <stdexcept>
#include <thread>
#include <vector>

#include "server/base/threads/clock.h"

namespace touchstone {

class ManualClock final : public Clock {
 public:
  Time Now() const override {
    std::lock_guard<std::mutex> lock(mutex_);
    return now_;
  }
  // Runs beside Now.
  double UnixNowS() const override { return kUnixAtZeroS + NowS(); }

  // Wakes whoever waits for a time up to then. The caller holds no lock that a waiting thread needs.
  void Advance(double seconds) {
    std::unique_lock<std::mutex> lock(mutex_);
    MoveTo(lock, now_ + DurationOf(seconds));
  }

  // Threads that wait for a time that has not come.
  int waiting() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return Waiting();
  }
  // Lets time pass until `done`, from one wait to the next, each time that at least so many threads wait.
  template <typename Done>
  void PassUntil(Done done, int waiters = 1) {
    while (!done()) {
      if (waiting() >= waiters)
        AdvanceToFirst();
      else
        std::this_thread::yield();
    }
  }

  // Returns once so many threads wait for a time that has not come. Throws where they do not within kPatience.
  void AwaitWaiters(int count = 1) const {
    std::unique_lock<std::mutex> lock(mutex_);
    Await(lock, count);
  }

  // Once so many threads wait: the time that the first of them waits for is now. What passed until then, in seconds.
  double AdvanceToFirst(int waiters = 1) {
    std::unique_lock<std::mutex> lock(mutex_);
    Await(lock, waiters);
    Time first = Time::max();
    for (const Waiter* waiter : waiters_)
      if (waiter->until > now_) first = std::min(first, waiter->until);
    const double passed_s = std::chrono::duration<double>(first - now_).count();
    MoveTo(lock, first);
    return passed_s;
  }

 private:
  struct Waiter {
    std::mutex* mutex;
    std::condition_variable* wakes;
    Time until;
    int held;  // by so many calls of MoveTo, which are about to wake it: it stays where it is
  };

  static constexpr double kUnixAtZeroS = 1.7e9;
  static constexpr std::chrono::seconds kPatience{60};  // of the machine's time, which may be busy

  void Await(std::unique_lock<std::mutex>& lock, int count) const {
    if (!changed_.wait_for(lock, kPatience, [&] { return Waiting() >= count; }))
      throw std::runtime_error("nobody waits for the clock");
  }

  static Duration DurationOf(double seconds) {
    return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(seconds));
  }

  int Waiting() const {
    return static_cast<int>(std::count_if(waiters_.begin(), waiters_.end(),
                                          [this](const Waiter* waiter) { return waiter->until > now_; }));
  }

  void MoveTo(std::unique_lock<std::mutex>& lock, Time time) {
    now_ = time;
    std::vector<Waiter*> due;
    for (Waiter* waiter : waiters_)
      if (waiter->until <= now_) due.push_back(waiter), ++waiter->held;
    lock.unlock();
    for (Waiter* waiter : due) {
      // It holds its mutex until it waits: whoever gets that finds it waiting.
      { std::lock_guard<std::mutex> waits(*waiter->mutex); }
      waiter->wakes->notify_all();
    }
    lock.lock();
    for (Waiter* waiter : due) --waiter->held;
    changed_.notify_all();
  }

  void WaitOnce(std::unique_lock<std::mutex>& lock, std::condition_variable& changed,
                Time until) const override {
    Waiter self{lock.mutex(), &changed, until, 0};
    {
      std::lock_guard<std::mutex> own(mutex_);
      if (now_ >= until) return;
      waiters_.push_back(&self);
      changed_.notify_all();
    }
    changed.wait(lock);
    // Without it: MoveTo may need it to let go of this waiter.
    lock.unlock();
    {
      std::unique_lock<std::mutex> own(mutex_);
      changed_.wait(own, [&] { return self.held == 0; });
      waiters_.erase(std::find(waiters_.begin(), waiters_.end(), &self));
      changed_.notify_all();
    }
    lock.lock();
  }

  mutable std::mutex
      mutex_;  // guards what follows; taken while a waiter's own is held, never the other way round
  mutable std::condition_variable changed_;
  mutable std::vector<Waiter*> waiters_;
  Time now_{std::chrono::hours(1)};
};

}  // namespace touchstone
