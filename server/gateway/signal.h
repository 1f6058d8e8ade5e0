// What the threads of the rig wake each other with: news came from the arm, the end effector, the lease or a client.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>

namespace touchstone {

// Seconds of the host's steady clock: the time that everything in the gateway is told in.
double HostNowS();

class Signal {
 public:
  // Any thread, after the state that others look at has changed.
  void Notify() {
    { std::lock_guard<std::mutex> lock(mutex_); }
    changed_.notify_all();
  }
  // Waits until `done` (called without any lock of the caller's held, after every Notify) or for so long; whether done.
  template <typename Done>
  bool WaitFor(double seconds, Done done) {
    const auto until = std::chrono::steady_clock::now() +
                       std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                           std::chrono::duration<double>(seconds));
    std::unique_lock<std::mutex> lock(mutex_);
    return changed_.wait_until(lock, until, done);
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
};

}  // namespace touchstone
