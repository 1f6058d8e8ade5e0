// The server that the page asks: one of several equal ones, or the simulation in this process.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include <grpcpp/channel.h>

#include "client/source/connection/connection.h"

namespace touchstone::workbench {

class Upstream {
 public:
  struct Server {
    std::shared_ptr<grpc::Channel> channel;
    std::string address;
  };
  // `connection` outlives it, and is its own from now on.
  explicit Upstream(client::Connection* connection);
  ~Upstream();
  Upstream(const Upstream&) = delete;
  Upstream& operator=(const Upstream&) = delete;

  Server server() const;
  int server_count() const { return connection_->server_count(); }  // 0: in this process
  // Where `lost` is still the one that is asked, connects to the next that answers. `then` is called from another thread, also
  // where that failed (UNAVAILABLE, with the servers that were tried).
  void FindAnother(Server lost, std::function<void(const absl::Status&)> then);
  // By its owner, before it lets go: calls that end later may be the last to hold it. What FindAnother has not begun is answered
  // with CANCELLED.
  void End();

 private:
  struct Search {
    Server lost;
    std::function<void(const absl::Status&)> then;
  };
  void Run();

  client::Connection* const connection_;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  Server server_;
  std::deque<Search> searches_;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace touchstone::workbench
