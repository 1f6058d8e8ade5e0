#include "server/gateway/arm/protocol/tcp_socket.h"

#include <absl/strings/str_cat.h>

#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace touchstone::gateway::arm {
namespace {

// A peer that acknowledges nothing for so long is gone, whatever the kernel would still hope for.
constexpr int kPeerTimeoutMs = 2000;

using Clock = std::chrono::steady_clock;

Clock::time_point Deadline(double timeout_s) {
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(timeout_s));
}

// Waits until the descriptor is ready; false: not in time.
bool WaitReady(int fd, short events, Clock::time_point deadline) {
  while (true) {
    const double left_s = std::chrono::duration<double>(deadline - Clock::now()).count();
    pollfd waiting{fd, events, 0};
    const int ready = poll(&waiting, 1, std::max(0, static_cast<int>(std::ceil(left_s * 1e3))));
    if (ready > 0) return true;
    if (ready == 0 && Clock::now() >= deadline) return false;
    if (ready < 0 && errno != EINTR) return true;  // the next call returns what is wrong
  }
}

absl::Status Broken(const std::string& name, int error) {
  return absl::UnavailableError(absl::StrCat(name, ": ", std::strerror(error)));
}

void SetOption(int fd, int level, int option, int value) {
  setsockopt(fd, level, option, &value, sizeof(value));
}

}  // namespace

absl::StatusOr<std::unique_ptr<TcpSocket>> TcpSocket::Connect(const std::string& address, int port,
                                                              double timeout_s) {
  const std::string name = absl::StrCat(address, ":", port);
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (const int error = getaddrinfo(address.c_str(), std::to_string(port).c_str(), &hints, &found);
      error != 0)
    return absl::UnavailableError(absl::StrCat(name, ": ", gai_strerror(error)));
  const int fd = socket(found->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0) {
    freeaddrinfo(found);
    return Broken(name, errno);
  }
  std::unique_ptr<TcpSocket> made(new TcpSocket(fd, name));
  SetOption(fd, IPPROTO_TCP, TCP_NODELAY, 1);
  SetOption(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, kPeerTimeoutMs);
  SetOption(fd, SOL_SOCKET, SO_KEEPALIVE, 1);
  SetOption(fd, IPPROTO_TCP, TCP_KEEPIDLE, 1);
  SetOption(fd, IPPROTO_TCP, TCP_KEEPINTVL, 1);
  SetOption(fd, IPPROTO_TCP, TCP_KEEPCNT, 3);
  const int result = connect(fd, found->ai_addr, found->ai_addrlen);
  const int why = errno;
  freeaddrinfo(found);
  if (result == 0) return made;
  if (why != EINPROGRESS) return Broken(name, why);
  if (!WaitReady(fd, POLLOUT, Deadline(timeout_s))) return Broken(name, ETIMEDOUT);
  int error = 0;
  socklen_t size = sizeof(error);
  getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size);
  if (error != 0) return Broken(name, error);
  return made;
}

TcpSocket::~TcpSocket() {
  close(fd_);
}

absl::Status TcpSocket::Send(absl::string_view bytes, double timeout_s) {
  const Clock::time_point deadline = Deadline(timeout_s);
  while (!bytes.empty()) {
    const ssize_t sent = send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent > 0) {
      bytes.remove_prefix(static_cast<size_t>(sent));
    } else if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
      if (!WaitReady(fd_, POLLOUT, deadline))
        return absl::UnavailableError(absl::StrCat(name_, ": takes no more bytes"));
    } else if (sent < 0 && errno != EINTR) {
      return Broken(name_, errno);
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<size_t> TcpSocket::Receive(char* buffer, size_t size, double timeout_s) {
  const Clock::time_point deadline = Deadline(timeout_s);
  while (true) {
    const ssize_t count = recv(fd_, buffer, size, 0);
    if (count > 0) return static_cast<size_t>(count);
    if (count == 0) return absl::UnavailableError(absl::StrCat(name_, ": closed by the controller"));
    if (errno == EINTR) continue;
    if (errno != EAGAIN && errno != EWOULDBLOCK) return Broken(name_, errno);
    if (!WaitReady(fd_, POLLIN, deadline)) return size_t{0};
  }
}

}  // namespace touchstone::gateway::arm
