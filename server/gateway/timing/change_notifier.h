// Wakes the threads of the rig when something has changed: the arm's state, the end effector, the lease, a client.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>

#include "server/gateway/timing/host_time.h"

namespace touchstone::gateway::timing {

// An event count: no lock is held while it waits, so that the woken thread may lock anything.
class ChangeNotifier {
 public:
  // Any thread, after what others look at has changed.
  void Notify() {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      ++count_;
    }
    changed_.notify_all();
  }
  // How often Notify was called: read it before looking at the state.
  uint64_t count() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return count_;
  }
  // Waits for a change since `seen`, at most so long.
  void WaitForChange(uint64_t seen, double max_s) const {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait_for(lock, std::chrono::duration<double>(max_s), [&] { return count_ != seen; });
  }

 private:
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  uint64_t count_ = 0;
};

}  // namespace touchstone::gateway::timing
