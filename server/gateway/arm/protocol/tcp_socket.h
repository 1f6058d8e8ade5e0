// One TCP connection to the controller. Every wait has a limit, in host seconds.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

namespace touchstone::gateway::arm {

// How long a connection may take, and the pause before the next attempt, which doubles each time.
inline constexpr double kConnectS = 1, kFirstPauseS = 0.05, kLongestPauseS = 1;

// Reading by one thread and sending by another at the same time is fine; two senders need a lock.
class TcpSocket {
 public:
  // UNAVAILABLE: "192.168.0.10:30004: Connection refused".
  static absl::StatusOr<std::unique_ptr<TcpSocket>> Connect(const std::string& address, int port,
                                                            double timeout_s);
  ~TcpSocket();
  TcpSocket(const TcpSocket&) = delete;
  TcpSocket& operator=(const TcpSocket&) = delete;

  // All of it, without delay on the line (TCP_NODELAY), or an error; after one the connection is of no use.
  absl::Status Send(absl::string_view bytes, double timeout_s);
  // What is there, as soon as something is; 0: nothing came in time. UNAVAILABLE: the other side
  // has closed it.
  absl::StatusOr<size_t> Receive(char* buffer, size_t size, double timeout_s);

 private:
  TcpSocket(int fd, std::string name) : fd_(fd), name_(std::move(name)) {}

  const int fd_;
  const std::string name_;
};

}  // namespace touchstone::gateway::arm
