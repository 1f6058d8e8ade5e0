// A server for tests of clients: listens on a free port and does with every connection what the test says.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace touchstone::gateway::arm {

class FakeServer {
 public:
  class Connection {
   public:
    Connection(int fd, const std::atomic<bool>* ending) : fd_(fd), ending_(ending) {}
    ~Connection() { close(fd_); }
    void Send(const std::string& bytes) { send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL); }
    // What came next; empty: closed, or the test ends.
    std::string Receive() {
      while (!*ending_) {
        pollfd waiting{fd_, POLLIN, 0};
        if (poll(&waiting, 1, 20) <= 0) continue;
        char buffer[4096];
        const ssize_t count = recv(fd_, buffer, sizeof(buffer), 0);
        return count > 0 ? std::string(buffer, static_cast<size_t>(count)) : std::string();
      }
      return "";
    }
    bool ending() const { return *ending_; }

   private:
    int fd_;
    const std::atomic<bool>* ending_;
  };

  // `serve` gets every connection and how many there were before; one after another.
  explicit FakeServer(std::function<void(Connection&, int number)> serve) {
    listening_ = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    bind(listening_, reinterpret_cast<sockaddr*>(&address), sizeof(address));
    listen(listening_, 16);
    socklen_t size = sizeof(address);
    getsockname(listening_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this, serve = std::move(serve)] {
      for (int number = 0; !ending_;) {
        pollfd waiting{listening_, POLLIN, 0};
        if (poll(&waiting, 1, 20) <= 0) continue;
        Connection connection(accept(listening_, nullptr, nullptr), &ending_);
        serve(connection, number++);
      }
    });
  }
  ~FakeServer() {
    ending_ = true;
    thread_.join();
    close(listening_);
  }
  int port() const { return port_; }

 private:
  int listening_ = -1, port_ = 0;
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

}  // namespace touchstone::gateway::arm
