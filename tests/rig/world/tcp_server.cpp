#include "tests/rig/world/tcp_server.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "tests/rig/world/system_error.h"

namespace touchstone::rig {
namespace {

constexpr size_t kLongestLine = 4096;
constexpr int kAcceptTurnMs = 100;

}  // namespace

bool LineConnection::ReadLine(std::string* line) {
  for (;;) {
    const size_t end = buffer_.find('\n');
    if (end != std::string::npos) {
      *line = buffer_.substr(0, end);
      buffer_.erase(0, end + 1);
      if (!line->empty() && line->back() == '\r') line->pop_back();
      return true;
    }
    if (buffer_.size() > kLongestLine) return false;
    char bytes[1024];
    const ssize_t got = recv(fd_, bytes, sizeof bytes, 0);
    if (got <= 0) return false;
    buffer_.append(bytes, static_cast<size_t>(got));
  }
}

bool LineConnection::Send(const std::string& bytes) {
  for (size_t sent = 0; sent < bytes.size();) {
    const ssize_t wrote = send(fd_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (wrote <= 0) return false;
    sent += static_cast<size_t>(wrote);
  }
  return true;
}

TcpServer::TcpServer(const std::string& address, int port, std::function<void(LineConnection&)> serve)
    : serve_(std::move(serve)) {
  sockaddr_in where{};
  where.sin_family = AF_INET;
  where.sin_port = htons(static_cast<uint16_t>(port));
  if (inet_pton(AF_INET, address.c_str(), &where.sin_addr) != 1)
    throw std::runtime_error("'" + address + "' is no IPv4 address");
  listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const int on = 1;
  setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  socklen_t length = sizeof where;
  if (listener_ < 0 || bind(listener_, reinterpret_cast<sockaddr*>(&where), sizeof where) != 0 ||
      listen(listener_, 16) != 0 ||
      getsockname(listener_, reinterpret_cast<sockaddr*>(&where), &length) != 0) {
    const int error = errno;
    if (listener_ >= 0) close(listener_);
    errno = error;
    FailWithErrno("cannot listen on " + address + ":" + std::to_string(port));
  }
  port_ = ntohs(where.sin_port);
  thread_ = std::thread([this] { Accept(); });
}

TcpServer::~TcpServer() {
  stopping_ = true;
  thread_.join();
  DropAll();
  Reap(true);
  close(listener_);
}

void TcpServer::DropAll() {
  std::lock_guard<std::mutex> lock(mutex_);
  for (auto& client : clients_)
    if (!client->done) shutdown(client->fd, SHUT_RDWR);
}

void TcpServer::Reap(bool all) {
  std::vector<std::unique_ptr<Client>> gone;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    for (size_t k = clients_.size(); k-- > 0;)
      if (all || clients_[k]->done) {
        gone.push_back(std::move(clients_[k]));
        clients_.erase(clients_.begin() + k);
      }
  }
  // The descriptor is closed here and nowhere else, so that DropAll never hits a number that was
  // given away anew.
  for (auto& client : gone) {
    client->thread.join();
    close(client->fd);
  }
}

void TcpServer::Accept() {
  while (!stopping_) {
    pollfd waiting{listener_, POLLIN, 0};
    poll(&waiting, 1, kAcceptTurnMs);
    Reap(false);
    if ((waiting.revents & POLLIN) == 0) continue;
    const int fd = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (fd < 0) continue;
    auto client = std::make_unique<Client>();
    client->fd = fd;
    Client* self = client.get();
    std::lock_guard<std::mutex> lock(mutex_);
    self->thread = std::thread([this, self] {
      LineConnection connection(self->fd);
      serve_(connection);
      shutdown(self->fd, SHUT_RDWR);
      self->done = true;
    });
    clients_.push_back(std::move(client));
  }
}

std::string AskOnce(const std::string& host_and_port, const std::string& line, double timeout_s) {
  const size_t colon = host_and_port.rfind(':');
  if (colon == std::string::npos) throw std::runtime_error("'" + host_and_port + "' is not HOST:PORT");
  addrinfo hints{}, *found = nullptr;
  hints.ai_family = AF_INET, hints.ai_socktype = SOCK_STREAM;
  if (const int error = getaddrinfo(host_and_port.substr(0, colon).c_str(),
                                    host_and_port.substr(colon + 1).c_str(), &hints, &found);
      error != 0)
    throw std::runtime_error("cannot find " + host_and_port + ": " + gai_strerror(error));
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  timeval timeout{static_cast<time_t>(timeout_s), 0};
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
  setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &timeout, sizeof timeout);
  const bool connected = connect(fd, found->ai_addr, found->ai_addrlen) == 0;
  const int error = errno;
  freeaddrinfo(found);
  LineConnection connection(fd);
  std::string answer;
  const bool answered = connected && connection.Send(line + "\n") && connection.ReadLine(&answer);
  close(fd);
  errno = error;
  if (!connected) FailWithErrno("cannot connect to " + host_and_port);
  if (!answered) throw std::runtime_error(host_and_port + " did not answer '" + line + "'");
  return answer;
}

}  // namespace touchstone::rig
