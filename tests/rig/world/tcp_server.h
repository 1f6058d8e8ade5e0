// A small TCP server for the emulator's camera and control port: a thread for each
// connection, few connections.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace touchstone::rig {

// A connected socket.
class LineConnection {
 public:
  explicit LineConnection(int fd) : fd_(fd) {}
  // The next line without its end; false: closed, or longer than 4096 bytes.
  bool ReadLine(std::string* line);
  bool Send(const std::string& bytes);  // false: closed
  int fd() const { return fd_; }

 private:
  int fd_;
  std::string buffer_;
};

class TcpServer {
 public:
  // Listens on `address`; port 0: any free one. `serve` runs in the connection's thread; the connection is
  // closed when it returns. Throws std::runtime_error.
  TcpServer(const std::string& address, int port, std::function<void(LineConnection&)> serve);
  ~TcpServer();  // closes every connection and joins
  TcpServer(const TcpServer&) = delete;
  TcpServer& operator=(const TcpServer&) = delete;

  int port() const { return port_; }
  // Ends every connection; the next ones are accepted as ever.
  void DropAll();

 private:
  struct Client {
    int fd;
    std::atomic<bool> done{false};
    std::thread thread;
  };
  void Accept();
  void Reap(bool all);

  int listener_ = -1, port_ = 0;
  std::function<void(LineConnection&)> serve_;
  std::atomic<bool> stopping_{false};
  std::mutex mutex_;
  std::vector<std::unique_ptr<Client>> clients_;
  std::thread thread_;
};

// Connects to HOST:PORT, sends one line, returns the one that is answered. Throws std::runtime_error.
std::string AskOnce(const std::string& host_and_port, const std::string& line, double timeout_s);

}  // namespace touchstone::rig
