// The controller's state at its full rate, and the two registers that this gateway writes. Connects, and
// connects again, by itself.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include <absl/status/status.h>

#include "server/gateway/arm/protocol/rtde_message.h"
#include "server/gateway/arm/protocol/tcp_socket.h"
#include "server/gateway/timing/change_notifier.h"

namespace touchstone::gateway::arm {

struct RtdeOptions {
  std::string address;
  int port = 30004;
  double rate_hz = 500;
  double silence_s = 2;  // host time without a package after which it connects again
};

class RtdeClient {
 public:
  // `on_sample` is called from the client's thread with every package and the host time of its arrival;
  // `on_link` when the link came or was lost.
  RtdeClient(RtdeOptions options, std::function<void(const RtdeSample&, double host_s)> on_sample,
             std::function<void()> on_link);
  ~RtdeClient();

  // OK while packages are agreed on; else UNAVAILABLE or why the controller refused, in words.
  absl::Status Link() const;
  std::string ControllerVersion() const;  // empty: not known yet

  // Both registers in one package, on the wire before it returns. Any thread; never waits for
  // the receiving one.
  absl::Status WriteInputs(int32_t heartbeat, int32_t command);

 private:
  void Run();
  absl::Status Negotiate(TcpSocket* socket);
  absl::StatusOr<std::string> Ask(TcpSocket* socket, RtdeType type, const std::string& payload);
  absl::Status Receive(TcpSocket* socket);
  void SetLink(absl::Status status);

  const RtdeOptions options_;
  const std::function<void(const RtdeSample&, double)> on_sample_;
  const std::function<void()> on_link_;

  // The receiving thread's own.
  RtdeFramer framer_;
  uint8_t output_recipe_ = 0;
  bool with_tcp_offset_ = true;

  mutable std::mutex mutex_;  // of link_ and version_
  absl::Status link_;
  std::string version_;
  std::mutex write_mutex_;  // of writer_ and its recipe
  std::shared_ptr<TcpSocket> writer_;
  uint8_t input_recipe_ = 0;

  std::atomic<bool> ending_{false};
  timing::ChangeNotifier end_;
  std::thread thread_;
};

}  // namespace touchstone::gateway::arm
