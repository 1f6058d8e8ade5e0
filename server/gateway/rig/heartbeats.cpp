#include "server/gateway/rig/heartbeats.h"

#include <chrono>
#include <utility>

#include "server/gateway/timing/host_time.h"

namespace touchstone::gateway {

Heartbeats::Heartbeats(std::function<void()> send) : send_(std::move(send)), thread_([this] { Run(); }) {}

Heartbeats::~Heartbeats() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void Heartbeats::Permit() {
  const double now_s = timing::HostNowS();
  bool idle;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    idle = until_s_ <= now_s;
    until_s_ = now_s + kPermitS;
  }
  if (idle) changed_.notify_all();
}

void Heartbeats::End() {
  std::lock_guard<std::mutex> lock(mutex_);
  until_s_ = 0;
}

void Heartbeats::Run() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!ending_) {
    if (until_s_ <= timing::HostNowS()) {
      changed_.wait(lock, [this] { return ending_ || until_s_ > timing::HostNowS(); });
      continue;
    }
    lock.unlock();
    send_();
    lock.lock();
    changed_.wait_for(lock, std::chrono::duration<double>(kPeriodS), [this] { return ending_; });
  }
}

}  // namespace touchstone::gateway
