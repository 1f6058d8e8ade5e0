// Whether the other side of a line has read what it was sent, so that time can wait for it.
#pragma once

#include <cstddef>

namespace touchstone::rig {

// Bytes that the peer of a connected TCP socket (IPv4) has received and not read. 0 also where this cannot be told: the
// peer is on another host, or the kernel has no sock_diag.
size_t UnreadByPeer(int fd);

// What was sent and the peer has not read, wherever it lies. With a peer on another host: what has not arrived there.
// 0 once the connection is closed.
size_t UnreadOrUnderway(int fd);

// How long one reader is waited for: one that has stopped or died does not stop the others' time.
class ReaderPatience {
 public:
  static constexpr double kPatienceS = 1;  // steady clock
  // Whether it is waited for: it has something to read, and has read something within kPatienceS.
  bool WaitsFor(size_t unread_bytes);

 private:
  size_t unread_bytes_ = 0;
  double since_s_ = 0;
  bool given_up_ = false;  // until it reads again
};

}  // namespace touchstone::rig
