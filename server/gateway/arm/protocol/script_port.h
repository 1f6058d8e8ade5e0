// A connection to the primary or secondary interface of the controller that is kept open: programs go in,
// states and messages come out.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include <absl/status/status.h>

#include "server/gateway/arm/protocol/primary_message.h"
#include "server/gateway/arm/protocol/tcp_socket.h"
#include "server/gateway/timing/change_notifier.h"

namespace touchstone::gateway::arm {

class ScriptPort {
 public:
  // `on_update` is called from a thread of this object's own.
  ScriptPort(std::string address, int port, std::function<void(const PrimaryUpdate&)> on_update);
  ~ScriptPort();

  // The program's text, on the wire before it returns; two sends are never mixed, and arrive in their order.
  // `after`, if given, is asked when the text has gone out and may give another text that must follow at
  // once. UNAVAILABLE: not connected.
  absl::Status Send(const std::string& program, const std::function<std::string()>& after = nullptr);
  // The same, but UNAVAILABLE if another send is under way for more than 15 ms.
  absl::Status TrySend(const std::string& program);
  bool Connected() const;

 private:
  void Run();
  absl::Status Receive(TcpSocket* socket);
  absl::Status SendLocked(const std::string& program);

  const std::string address_;
  const int port_;
  const std::function<void(const PrimaryUpdate&)> on_update_;
  mutable std::timed_mutex mutex_;  // of writer_
  std::shared_ptr<TcpSocket> writer_;
  std::atomic<bool> ending_{false};
  timing::ChangeNotifier end_;
  std::thread thread_;
};

}  // namespace touchstone::gateway::arm
