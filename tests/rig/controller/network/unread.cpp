#include "tests/rig/controller/network/unread.h"

#include <linux/inet_diag.h>
#include <linux/netlink.h>
#include <linux/sock_diag.h>
#include <linux/sockios.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstring>
#include <utility>

#include "tests/rig/controller/network/net.h"

namespace touchstone::rig {
namespace {

// A thread's own connection to the kernel's table of sockets; -1: there is none.
class SocketTable {
 public:
  SocketTable() : fd_(socket(AF_NETLINK, SOCK_DGRAM | SOCK_CLOEXEC, NETLINK_SOCK_DIAG)) {}
  ~SocketTable() {
    if (fd_ >= 0) close(fd_);
  }
  SocketTable(const SocketTable&) = delete;
  SocketTable& operator=(const SocketTable&) = delete;

  // Of the socket that is bound to `own` and connected to `peer`.
  size_t Unread(const sockaddr_in& own, const sockaddr_in& peer) const {
    struct {
      nlmsghdr header;
      inet_diag_req_v2 request;
    } asked;
    std::memset(&asked, 0, sizeof asked);
    asked.header.nlmsg_len = sizeof asked;
    asked.header.nlmsg_type = SOCK_DIAG_BY_FAMILY;
    asked.header.nlmsg_flags = NLM_F_REQUEST;
    asked.request.sdiag_family = AF_INET;
    asked.request.sdiag_protocol = IPPROTO_TCP;
    asked.request.idiag_states = ~0u;
    asked.request.id.idiag_sport = own.sin_port;
    asked.request.id.idiag_dport = peer.sin_port;
    asked.request.id.idiag_src[0] = own.sin_addr.s_addr;
    asked.request.id.idiag_dst[0] = peer.sin_addr.s_addr;
    asked.request.id.idiag_cookie[0] = asked.request.id.idiag_cookie[1] = INET_DIAG_NOCOOKIE;
    if (fd_ < 0 || send(fd_, &asked, sizeof asked, MSG_DONTWAIT) < 0) return 0;
    alignas(nlmsghdr) char answer[4096];
    const ssize_t got = recv(fd_, answer, sizeof answer, MSG_DONTWAIT);
    nlmsghdr header;
    inet_diag_msg found;
    if (got < static_cast<ssize_t>(NLMSG_LENGTH(sizeof found))) return 0;
    std::memcpy(&header, answer, sizeof header);
    if (header.nlmsg_type != SOCK_DIAG_BY_FAMILY) return 0;  // no such socket on this host
    std::memcpy(&found, answer + NLMSG_HDRLEN, sizeof found);
    return found.idiag_rqueue;
  }

 private:
  const int fd_;
};

}  // namespace

size_t UnreadByPeer(int fd) {
  thread_local const SocketTable table;
  sockaddr_in own{}, peer{};
  socklen_t own_size = sizeof own, peer_size = sizeof peer;
  if (getsockname(fd, reinterpret_cast<sockaddr*>(&own), &own_size) != 0 ||
      getpeername(fd, reinterpret_cast<sockaddr*>(&peer), &peer_size) != 0 || peer.sin_family != AF_INET)
    return 0;
  return table.Unread(peer, own);
}

size_t UnreadOrUnderway(int fd) {
  // In this order: what arrives in between is counted twice rather than not at all.
  int underway = 0;
  if (ioctl(fd, SIOCOUTQ, &underway) != 0) underway = 0;
  // The kernel counts what was sent to a peer that has closed for ever.
  tcp_info connection{};
  socklen_t size = sizeof connection;
  if (getsockopt(fd, IPPROTO_TCP, TCP_INFO, &connection, &size) != 0 || connection.tcpi_state == TCP_CLOSE)
    return 0;
  return static_cast<size_t>(underway) + UnreadByPeer(fd);
}

bool ReaderPatience::WaitsFor(size_t unread_bytes) {
  const bool read = unread_bytes < unread_bytes_ || unread_bytes == 0;
  const double now_s = HostNowS();
  if (read || unread_bytes_ == 0) since_s_ = now_s;
  if (read)
    given_up_ = false;
  else if (now_s - since_s_ > kPatienceS)
    given_up_ = true;
  unread_bytes_ = unread_bytes;
  return unread_bytes > 0 && !given_up_;
}

}  // namespace touchstone::rig
