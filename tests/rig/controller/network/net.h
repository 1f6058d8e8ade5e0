// Sockets of the emulated controller: listening, and connections that never wait for their peers.
#pragma once

#include <deque>
#include <string>

namespace touchstone::rig {

double HostNowS();  // steady clock

// Listens on address:port (0: any); throws std::runtime_error. Returns the descriptor and sets the port.
int Listen(const std::string& address, int port, int* bound_port);

// One accepted connection; closes its descriptor.
class QueuedConnection {
 public:
  explicit QueuedConnection(int fd);
  ~QueuedConnection();
  QueuedConnection(const QueuedConnection&) = delete;
  QueuedConnection& operator=(const QueuedConnection&) = delete;

  int fd() const { return fd_; }
  bool open() const { return open_; }
  void Close() { open_ = false; }
  // Everything that has come; false once the peer has gone.
  bool Read(std::string* to);
  // Queues, to leave at `release_host_s` at the earliest and never before what was queued earlier.
  void Send(std::string bytes, double release_host_s = 0);
  // Sends what may leave now.
  void Flush(double host_s);
  bool Blocked() const { return blocked_; }  // the peer does not read: wants to be told when it does again
  bool Busy() const { return blocked_ || queued_bytes_ > kMaxQueued / 4; }
  double NextReleaseS() const;  // infinite: nothing waits for its time
  void CloseWhenSent() { closing_ = true; }

 private:
  static constexpr size_t kMaxQueued = 1 << 20;

  struct Packet {
    double release_host_s;
    std::string bytes;
  };
  int fd_;
  bool open_ = true, blocked_ = false, closing_ = false;
  std::deque<Packet> queue_;
  size_t queued_bytes_ = 0;
};

}  // namespace touchstone::rig
