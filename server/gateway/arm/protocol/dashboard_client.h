// The dashboard of the controller: power, brakes, modes; a line asked, a line answered.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include <absl/status/statusor.h>

#include "server/gateway/arm/protocol/tcp_socket.h"

namespace touchstone::gateway::arm {

// What stands around the sending of a command, which it is handed: it may refuse, and then the command is not sent.
using SendGate = std::function<absl::Status(const std::function<absl::Status()>& send)>;

// Any thread; one command at a time. Connects when it is needed.
class DashboardClient {
 public:
  DashboardClient(std::string address, int port) : address_(std::move(address)), port_(port) {}

  // The reply without its end of line. UNAVAILABLE: no connection, or no reply in time (host seconds); else the gate's
  // refusal.
  absl::StatusOr<std::string> Ask(const std::string& command, double timeout_s,
                                  const SendGate& gate = nullptr);
  // The same, and FAILED_PRECONDITION if the reply does not begin with `expected`.
  absl::Status Demand(const std::string& command, const std::string& expected, double timeout_s,
                      const SendGate& gate = nullptr);

 private:
  absl::StatusOr<std::string> ReadLine(double until_host_s);

  const std::string address_;
  const int port_;
  std::mutex mutex_;
  std::unique_ptr<TcpSocket> socket_;
  std::string unread_;
};

}  // namespace touchstone::gateway::arm
