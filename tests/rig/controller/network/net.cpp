#include "tests/rig/controller/network/net.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <limits>
#include <stdexcept>

namespace touchstone::rig {

double HostNowS() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

int Listen(const std::string& address, int port, int* bound_port) {
  const auto fail = [&](int fd, const std::string& what) {
    const std::string why = std::strerror(errno);
    if (fd >= 0) close(fd);
    throw std::runtime_error("emulated controller: " + what + " " + address + ":" + std::to_string(port) +
                             ": " + why);
  };
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_port = htons(static_cast<uint16_t>(port));
  if (port < 0 || port > 65535 || inet_pton(AF_INET, address.c_str(), &at.sin_addr) != 1) {
    errno = EINVAL;
    fail(-1, "no such address (an IPv4 address and a port from 0 to 65535 are needed):");
  }
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0) fail(fd, "no socket for");
  const int on = 1;
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (bind(fd, reinterpret_cast<sockaddr*>(&at), sizeof at) != 0) fail(fd, "cannot bind");
  if (listen(fd, 16) != 0) fail(fd, "cannot listen on");
  socklen_t size = sizeof at;
  getsockname(fd, reinterpret_cast<sockaddr*>(&at), &size);
  *bound_port = ntohs(at.sin_port);
  return fd;
}

QueuedConnection::QueuedConnection(int fd) : fd_(fd) {
  const int on = 1;
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  // A small buffer: a client that reads slowly gets new packets soon, as behind a real controller's.
  const int buffer = 64 * 1024;
  setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &buffer, sizeof buffer);
}

QueuedConnection::~QueuedConnection() {
  close(fd_);
}

bool QueuedConnection::Read(std::string* to) {
  char buffer[16384];
  // Bounded, so that a client that floods does not stop the arm.
  for (int i = 0; i < 16; ++i) {
    const ssize_t got = recv(fd_, buffer, sizeof buffer, MSG_DONTWAIT);
    if (got > 0) {
      to->append(buffer, static_cast<size_t>(got));
      continue;
    }
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return true;
    open_ = false;
    return false;
  }
  return true;
}

void QueuedConnection::Send(std::string bytes, double release_host_s) {
  if (bytes.empty()) return;
  if (queued_bytes_ + bytes.size() > kMaxQueued) {  // never reads
    open_ = false;
    return;
  }
  if (!queue_.empty()) release_host_s = std::max(release_host_s, queue_.back().release_host_s);
  queued_bytes_ += bytes.size();
  queue_.push_back({release_host_s, std::move(bytes)});
}

void QueuedConnection::Flush(double host_s) {
  blocked_ = false;
  while (open_ && !queue_.empty() && queue_.front().release_host_s <= host_s) {
    std::string& bytes = queue_.front().bytes;
    const ssize_t sent = send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
      blocked_ = true;
      return;
    }
    if (sent < 0) {
      open_ = false;
      return;
    }
    queued_bytes_ -= static_cast<size_t>(sent);
    if (static_cast<size_t>(sent) < bytes.size())
      bytes.erase(0, static_cast<size_t>(sent));
    else
      queue_.pop_front();
  }
  if (closing_ && queue_.empty()) open_ = false;
}

double QueuedConnection::NextReleaseS() const {
  return queue_.empty() || blocked_ ? std::numeric_limits<double>::infinity() : queue_.front().release_host_s;
}

}  // namespace touchstone::rig
