#include "client/workbench_server/http/upstream.h"

#include <utility>

namespace touchstone::workbench {

Upstream::Upstream(client::Connection* connection)
    : connection_(connection), server_{connection->channel(), connection->address()} {
  if (server_count() > 1) thread_ = std::thread(&Upstream::Run, this);
}

Upstream::~Upstream() {
  End();
}

void Upstream::End() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
  std::deque<Search> left;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    left.swap(searches_);
  }
  for (const Search& search : left) search.then(absl::CancelledError("touchstone workbench ends"));
}

Upstream::Server Upstream::server() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return server_;
}

void Upstream::FindAnother(Server lost, std::function<void(const absl::Status&)> then) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    searches_.push_back({std::move(lost), std::move(then)});
  }
  changed_.notify_all();
}

void Upstream::Run() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return ending_ || !searches_.empty(); });
    if (ending_) return;
    const Search search = std::move(searches_.front());
    searches_.pop_front();
    absl::Status status;
    if (search.lost.channel == server_.channel) {
      lock.unlock();
      status = connection_->ConnectToNext();
      lock.lock();
      if (status.ok()) server_ = {connection_->channel(), connection_->address()};
    }
    lock.unlock();
    search.then(status);
    lock.lock();
  }
}

}  // namespace touchstone::workbench
