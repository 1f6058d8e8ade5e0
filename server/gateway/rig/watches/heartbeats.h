// The heartbeats for the controller's watchdog, from a thread of their own, so that nothing that a motion waits for
// (the end effector's line, a disk) can hold them up.
//
// They come only as long as a supervisor renews its permit: one that hangs, or that died without a word, lets it run
// out, and the controller's watchdog ends the program.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

#include "server/gateway/timing/host_time.h"

namespace touchstone::gateway {

class Heartbeats {
 public:
  static constexpr double kPeriodS = 0.01;  // between two, host time
  // How long one renewal lasts, host time. Supervisors renew every 10 ms, whatever they wait for; the rest is for a
  // machine that is busy. A supervisor that hangs has its arm stopped this long and one period of the watchdog later.
  static constexpr double kPermitS = 0.25;

  // `send` is called from the thread.
  explicit Heartbeats(std::function<void()> send, const Clock& clock = timing::HostClock());
  ~Heartbeats();
  Heartbeats(const Heartbeats&) = delete;
  Heartbeats& operator=(const Heartbeats&) = delete;

  // Heartbeats are sent for kPermitS from now on. Any thread.
  void Permit();
  // None is begun any more: nothing is under way. One that is being sent may still go out, which feeds the watchdog once.
  void End();

 private:
  void Run();

  const std::function<void()> send_;
  const Clock& clock_;
  std::mutex mutex_;  // of what follows
  std::condition_variable changed_;
  Clock::Time until_{};
  bool ending_ = false;
  std::thread thread_;  // last
};

// Heartbeats as long as it lives and Permit is called.
class HeartbeatScope {
 public:
  explicit HeartbeatScope(Heartbeats* heartbeats) : heartbeats_(heartbeats) { heartbeats_->Permit(); }
  ~HeartbeatScope() { heartbeats_->End(); }
  HeartbeatScope(const HeartbeatScope&) = delete;
  HeartbeatScope& operator=(const HeartbeatScope&) = delete;

 private:
  Heartbeats* const heartbeats_;
};

}  // namespace touchstone::gateway
