// Stands between the sockets of clients and gRPC: passes the bytes of each connection on in both directions, and counts the
// frames of HTTP/2 before gRPC sees them (frame_meter.h). A connection that asks for more than it may is read no faster, and
// closed if it goes on. gRPC gets one end of a pair of sockets, once the client has spoken.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "server/service/connections/frame_meter.h"
#include "server/service/connections/sparse_warning.h"
#include "server/service/connections/wire.h"
#include "server/service/options/limits.h"

namespace touchstone::service {

// What others may see of a connection, and do to it. Thread-safe.
class RelayedConnection {
 public:
  RelayedConnection(std::string peer, bool only_stop, int wake)
      : peer_(std::move(peer)), only_stop_(only_stop), wake_(wake) {}

  const std::string& peer() const { return peer_; }  // "ipv4:10.0.0.7:4711"
  bool only_stop() const { return only_stop_; }
  bool closed() const { return closed_; }
  bool spoke() const { return spoke_; }
  bool idle() const { return open_calls_ == 0; }
  // When it last became idle, in seconds of the steady clock.
  double idle_since_s() const { return idle_since_s_; }
  // Closes it soon if it is idle, politely: its client makes a new one when it has a call.
  void AskToClose();
  bool close_asked() const { return close_asked_; }

 private:
  friend class ConnectionRelay;
  const std::string peer_;
  const bool only_stop_;
  const int wake_;  // an eventfd of its thread
  std::atomic<bool> closed_{false}, spoke_{false}, close_asked_{false};
  std::atomic<size_t> open_calls_{0};
  std::atomic<double> idle_since_s_{0};
};

struct NewConnection {
  int file;  // the relay's from now on
  std::unique_ptr<Wire> wire;
  std::string peer;
  std::shared_ptr<FrameMeter::AddressCalls> address_calls;
  bool only_stop;  // see FrameMeter
};

class ConnectionRelay {
 public:
  // Hands gRPC the end of a connection that is its.
  using HandOver = std::function<void(int file)>;
  // `limits` outlives it.
  ConnectionRelay(const Limits& limits, int threads, HandOver hand_over);
  ~ConnectionRelay();  // closes what is left
  ConnectionRelay(const ConnectionRelay&) = delete;
  ConnectionRelay& operator=(const ConnectionRelay&) = delete;

  std::shared_ptr<RelayedConnection> Add(NewConnection connection);
  // Connections that are open.
  size_t size() const { return size_; }

 private:
  class Thread;
  std::atomic<size_t> size_{0};
  SparseWarning floods_;
  std::unique_ptr<SharedResets> resets_;
  std::vector<std::unique_ptr<Thread>> threads_;
  std::atomic<size_t> next_{0};
};

}  // namespace touchstone::service
