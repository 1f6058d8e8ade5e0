#include "server/gateway/rig/watches/heartbeats.h"

#include <utility>

namespace touchstone::gateway {

Heartbeats::Heartbeats(std::function<void()> send, const Clock& clock)
    : send_(std::move(send)), clock_(clock), thread_([this] { Run(); }) {}

Heartbeats::~Heartbeats() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void Heartbeats::Permit() {
  const Clock::Time now = clock_.Now(), until = clock_.In(kPermitS);
  bool idle;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    idle = until_ <= now;
    until_ = until;
  }
  if (idle) changed_.notify_all();
}

void Heartbeats::End() {
  std::lock_guard<std::mutex> lock(mutex_);
  until_ = {};
}

void Heartbeats::Run() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!ending_) {
    if (until_ <= clock_.Now()) {
      clock_.WaitFor(lock, changed_, Clock::kLongestS, [this] { return ending_ || until_ > clock_.Now(); });
      continue;
    }
    lock.unlock();
    send_();
    lock.lock();
    clock_.WaitFor(lock, changed_, kPeriodS, [this] { return ending_; });
  }
}

}  // namespace touchstone::gateway
