// The time that passes, behind one seam. What waits, or measures how long something took, is handed a Clock; the default is
// the steady clock, and a test hands over a ManualClock (manual_clock.h) that it moves itself.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>

namespace touchstone {

// All functions may be called from any thread.
class Clock {
 public:
  using Time = std::chrono::steady_clock::time_point;
  using Duration = std::chrono::steady_clock::duration;

  virtual ~Clock() = default;
  virtual Time Now() const = 0;
  // In seconds since the steady clock's zero.
  double NowS() const;
  double SecondsSince(Time begin) const;
  // The wall clock: seconds since 1970 (UTC), for records; it may step.
  virtual double UnixNowS() const = 0;

  // Waits until `over()` or that time, and returns what `over()` says then. `lock` guards what `over` looks at; whoever
  // changes that notifies `changed`.
  template <typename Over>
  bool WaitUntil(std::unique_lock<std::mutex>& lock, std::condition_variable& changed, Time until,
                 Over over) const {
    while (!over()) {
      if (Now() >= until) return false;
      WaitOnce(lock, changed, until);
    }
    return true;
  }
  template <typename Over>
  bool WaitFor(std::unique_lock<std::mutex>& lock, std::condition_variable& changed, double seconds,
               Over over) const {
    return WaitUntil(lock, changed, In(seconds), over);
  }
  void SleepFor(double seconds) const;
  // So many seconds from now, at the most kLongestS.
  Time In(double seconds) const;

  static constexpr double kLongestS = 1e9;  // durations in nanoseconds end at 9.2e9 s

 private:
  // Waits for `changed` or that time, or less.
  virtual void WaitOnce(std::unique_lock<std::mutex>& lock, std::condition_variable& changed,
                        Time until) const = 0;
};

const Clock& SteadyClock();

}  // namespace touchstone
