#include "server/service/connections/connection_acceptor.h"

#include <absl/strings/str_cat.h>
#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <iterator>
#include <utility>

#include "server/base/status.h"
#include "server/service/channel/host_port.h"
#include "server/service/connections/certificate_stamp.h"

namespace touchstone::service {
namespace {

constexpr double kShareOfFiles = 0.8;
// The client's socket, and a pair of the relay and gRPC.
constexpr size_t kFilesOfConnection = 3;
constexpr size_t kSpareFiles = 24;  // beyond the share, for stops
constexpr int kRelayThreads = 2;
constexpr size_t kManyAddresses = 1000;  // then those without a connection are forgotten

uint64_t FileLimit() {
  rlimit limit;
  return ::getrlimit(RLIMIT_NOFILE, &limit) == 0 ? limit.rlim_cur : 1024;
}

// As gRPC writes it: "ipv4:10.0.0.7", "ipv6:[::1]"; an IPv4 address that came through an IPv6 listener is one of IPv4.
std::string AddressOf(const sockaddr_storage& peer) {
  char text[INET6_ADDRSTRLEN] = "";
  if (peer.ss_family == AF_INET) {
    ::inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(&peer)->sin_addr, text, sizeof text);
    return absl::StrCat("ipv4:", text);
  }
  const in6_addr& address = reinterpret_cast<const sockaddr_in6*>(&peer)->sin6_addr;
  if (IN6_IS_ADDR_V4MAPPED(&address)) {
    ::inet_ntop(AF_INET, &address.s6_addr[12], text, sizeof text);
    return absl::StrCat("ipv4:", text);
  }
  ::inet_ntop(AF_INET6, &address, text, sizeof text);
  return absl::StrCat("ipv6:[", text, "]");
}

int PortOf(const sockaddr_storage& address) {
  return ntohs(address.ss_family == AF_INET6 ? reinterpret_cast<const sockaddr_in6*>(&address)->sin6_port
                                             : reinterpret_cast<const sockaddr_in*>(&address)->sin_port);
}

int PortOf(int file) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  return ::getsockname(file, reinterpret_cast<sockaddr*>(&address), &size) == 0 ? PortOf(address) : 0;
}

void SetPort(sockaddr* address, int port) {
  if (address->sa_family == AF_INET6)
    reinterpret_cast<sockaddr_in6*>(address)->sin6_port = htons(static_cast<uint16_t>(port));
  else
    reinterpret_cast<sockaddr_in*>(address)->sin_port = htons(static_cast<uint16_t>(port));
}

// -1: errno says why.
int OpenListener(const addrinfo& at) {
  const int file = ::socket(at.ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (file < 0) return -1;
  const int yes = 1, no = 0;
  ::setsockopt(file, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  // [::] takes IPv4 too, as gRPC's own listener does.
  if (at.ai_family == AF_INET6) ::setsockopt(file, IPPROTO_IPV6, IPV6_V6ONLY, &no, sizeof no);
  if (::bind(file, at.ai_addr, at.ai_addrlen) == 0 && ::listen(file, SOMAXCONN) == 0) return file;
  const int error = errno;
  ::close(file);
  errno = error;
  return -1;
}

}  // namespace

uint64_t RaiseFileLimit() {
  rlimit limit;
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur < limit.rlim_max) {
    limit.rlim_cur = limit.rlim_max;
    ::setrlimit(RLIMIT_NOFILE, &limit);
  }
  return FileLimit();
}

ConnectionAcceptor::ConnectionAcceptor(const Limits& limits, ServerCertificates* certificates)
    : limits_(limits),
      max_files_(limits.max_connections > 0 ? limits.max_connections
                                            : static_cast<size_t>(std::min(kShareOfFiles * FileLimit(),
                                                                           static_cast<double>(1 << 30)))),
      tls_(certificates == nullptr ? nullptr : std::make_unique<TlsPort>(certificates)) {}

std::unique_ptr<Wire> ConnectionAcceptor::WireOf(int file) {
  if (tls_ == nullptr) return PlainWire(file);
  std::unique_ptr<Wire> wire = tls_->Accept(file);
  return wire == nullptr ? nullptr : Stamped(std::move(wire));
}

absl::StatusOr<std::unique_ptr<ConnectionAcceptor>> ConnectionAcceptor::Listen(
    const std::string& address, const Limits& limits, ServerCertificates* certificates) {
  std::unique_ptr<ConnectionAcceptor> acceptor(new ConnectionAcceptor(limits, certificates));
  TOUCHSTONE_RETURN_IF_ERROR(acceptor->Open(address));
  return acceptor;
}

absl::Status ConnectionAcceptor::Open(const std::string& address) {
  const auto failed = [&](absl::string_view why) {
    return absl::UnavailableError(absl::StrCat("listen = '", address, "': cannot listen there: ", why,
                                               "; is the address right, and the port free?"));
  };
  const std::optional<HostPort> parsed = ParseHostPort(address);
  if (!parsed)
    return absl::InvalidArgumentError(absl::StrCat(
        "listen = '", address,
        "': write HOST:PORT with a port up to 65535 (0: any free one), for instance 127.0.0.1:50051"));
  addrinfo hints{}, *found = nullptr;
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  const int error = ::getaddrinfo(parsed->host.empty() ? nullptr : parsed->host.c_str(),
                                  absl::StrCat(parsed->port).c_str(), &hints, &found);
  if (error != 0) return failed(::gai_strerror(error));
  std::string why = "no address";
  for (const addrinfo* at = found; at != nullptr; at = at->ai_next) {
    if (port_ != 0) SetPort(at->ai_addr, port_);
    const int file = OpenListener(*at);
    if (file < 0) {
      why = std::strerror(errno);
      // "localhost" may name an address that this machine does not have; a port that is taken is an error.
      if (errno == EADDRINUSE && !listeners_.empty() && at->ai_family == AF_INET) continue;
      if (errno == EADDRINUSE) break;
      continue;
    }
    listeners_.push_back(file);
    if (port_ == 0) port_ = PortOf(file);
    why.clear();
  }
  ::freeaddrinfo(found);
  if (listeners_.empty() || why == std::strerror(EADDRINUSE)) return failed(why);
  wake_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  return wake_ < 0 ? failed(std::strerror(errno)) : absl::OkStatus();
}

ConnectionAcceptor::~ConnectionAcceptor() {
  End();
  for (const int listener : listeners_) ::close(listener);
  if (wake_ >= 0) ::close(wake_);
}

void ConnectionAcceptor::Begin(
    std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> grpc_acceptor) {
  grpc_acceptor_ = std::move(grpc_acceptor);
  relay_ = std::make_unique<ConnectionRelay>(limits_, kRelayThreads, [this](int file) {
    grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters parameters;
    parameters.listener_fd = -1;
    parameters.fd = file;
    grpc_acceptor_->HandleNewConnection(&parameters);
  });
  thread_ = std::thread([this] { Run(); });
}

void ConnectionAcceptor::End() {
  if (!thread_.joinable()) return;
  const uint64_t one = 1;
  (void)!::write(wake_, &one, sizeof one);
  thread_.join();
  // Those who come now are refused by the system.
  for (const int listener : listeners_) ::close(listener);
  listeners_.clear();
}

void ConnectionAcceptor::Run() {
  std::vector<pollfd> files;
  for (const int listener : listeners_) files.push_back({listener, POLLIN, 0});
  files.push_back({wake_, POLLIN, 0});
  for (;;) {
    if (::poll(files.data(), files.size(), -1) < 0) continue;  // a signal
    if (files.back().revents != 0) return;
    for (const pollfd& file : files)
      if (file.revents != 0) Take(file.fd);
  }
}

void ConnectionAcceptor::Take(int listener) {
  for (;;) {
    sockaddr_storage peer{};
    socklen_t size = sizeof peer;
    const int file =
        ::accept4(listener, reinterpret_cast<sockaddr*>(&peer), &size, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (file < 0) {
      if (errno == EINTR || errno == ECONNABORTED) continue;
      // No file at all is left: other parts of the program have them. Later there will be one.
      if (errno == EMFILE || errno == ENFILE || errno == ENOMEM || errno == ENOBUFS)
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
      return;
    }
    const std::string address = AddressOf(peer);
    const Room room = RoomFor(file, address);
    std::unique_ptr<Wire> wire = room == Room::kNone ? nullptr : WireOf(file);
    if (wire == nullptr) {
      ::close(file);
      continue;
    }
    const int yes = 1;
    ::setsockopt(file, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    Address& own = by_address_[address];
    own.connections.push_back(relay_->Add(
        {file, std::move(wire), absl::StrCat(address, ":", PortOf(peer)), own.calls, room == Room::kStop}));
  }
}

void ConnectionAcceptor::ForgetClosed(Connections* connections) {
  connections->erase(std::remove_if(connections->begin(), connections->end(),
                                    [](const auto& each) { return each->closed(); }),
                     connections->end());
}

RelayedConnection* ConnectionAcceptor::LongestIdle(const Connections& connections, bool only_stop) {
  RelayedConnection* found = nullptr;
  // Those that have said nothing go first.
  const auto order = [](const RelayedConnection& each) {
    return std::make_pair(each.spoke(), each.idle_since_s());
  };
  for (const auto& each : connections)
    if (each->only_stop() == only_stop && each->idle() && !each->close_asked() && !each->closed() &&
        (found == nullptr || order(*each) < order(*found)))
      found = each.get();
  return found;
}

// A full house has room for who comes if somebody in it has no call; else for a stop.
ConnectionAcceptor::Room ConnectionAcceptor::RoomFor(int file, const std::string& address) {
  if (by_address_.size() >= kManyAddresses)
    for (auto each = by_address_.begin(); each != by_address_.end();) {
      ForgetClosed(&each->second.connections);
      each = each->second.connections.empty() ? by_address_.erase(each) : std::next(each);
    }
  Connections& own = by_address_[address].connections;
  ForgetClosed(&own);
  const size_t stops =
      std::count_if(own.begin(), own.end(), [](const auto& each) { return each->only_stop(); });
  // The system gives the lowest number that is free, so that all below it are in use.
  const size_t files = std::max<size_t>(file, (relay_->size() + 1) * kFilesOfConnection);
  const bool own_full = own.size() - stops >= static_cast<size_t>(limits_.max_connections_per_address);
  if (!own_full && files < max_files_) return Room::kAny;
  RelayedConnection* idle = LongestIdle(own, false);
  if (!own_full)
    for (const auto& [other, each] : by_address_)
      if (idle == nullptr) idle = LongestIdle(each.connections, false);
  if (idle != nullptr) {
    idle->AskToClose();
    return Room::kAny;
  }
  full_.Say(absl::StrCat(
      address,
      own_full
          ? absl::StrCat(" has ", own.size(), " connections with calls already (max_connections_per_address)")
          : absl::StrCat(": ", files, " files are in use already (max_connections)"),
      ": one more is for Control.Stop alone"));
  if (files >= max_files_ + kSpareFiles) return Room::kNone;
  if (stops < kOnlyStopPerAddress) return Room::kStop;
  RelayedConnection* const silent = LongestIdle(own, true);
  if (silent == nullptr) return Room::kNone;
  silent->AskToClose();
  return Room::kStop;
}

}  // namespace touchstone::service
