#include "server/service/connection_acceptor.h"

#include <absl/strings/str_cat.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <iterator>

#include "server/base/status.h"
#include "server/service/host_port.h"

namespace touchstone::service {
namespace {

constexpr double kShareOfFiles = 0.8;
constexpr size_t kManyAddresses = 1000;  // then those without a connection are forgotten

uint64_t FileLimit() {
  rlimit limit;
  return ::getrlimit(RLIMIT_NOFILE, &limit) == 0 ? limit.rlim_cur : 1024;
}

// Of the socket behind a file; 0: the file is closed.
uint64_t InodeOf(int file) {
  struct stat info;
  return ::fstat(file, &info) == 0 && S_ISSOCK(info.st_mode) ? info.st_ino : 0;
}

std::string HostOf(const sockaddr_storage& peer, socklen_t size) {
  char host[NI_MAXHOST] = "";
  ::getnameinfo(reinterpret_cast<const sockaddr*>(&peer), size, host, sizeof host, nullptr, 0,
                NI_NUMERICHOST);
  return host;
}

int PortOf(int file) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  if (::getsockname(file, reinterpret_cast<sockaddr*>(&address), &size) != 0) return 0;
  return ntohs(address.ss_family == AF_INET6 ? reinterpret_cast<sockaddr_in6*>(&address)->sin6_port
                                             : reinterpret_cast<sockaddr_in*>(&address)->sin_port);
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

ConnectionAcceptor::ConnectionAcceptor(const Limits& limits)
    : max_file_(limits.max_connections > 0
                    ? limits.max_connections
                    : static_cast<int>(std::min(kShareOfFiles * FileLimit(), static_cast<double>(1 << 30)))),
      max_per_address_(limits.max_connections_per_address) {}

absl::StatusOr<std::unique_ptr<ConnectionAcceptor>> ConnectionAcceptor::Listen(const std::string& address,
                                                                               const Limits& limits) {
  std::unique_ptr<ConnectionAcceptor> acceptor(new ConnectionAcceptor(limits));
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
    if (!HasRoom(file, HostOf(peer, size))) {
      ::close(file);
      continue;
    }
    const int yes = 1;
    ::setsockopt(file, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters parameters;
    parameters.listener_fd = listener;
    parameters.fd = file;
    grpc_acceptor_->HandleNewConnection(&parameters);
  }
}

void ConnectionAcceptor::ForgetClosed(std::vector<Connection>* connections) {
  connections->erase(std::remove_if(connections->begin(), connections->end(),
                                    [](const Connection& each) { return InodeOf(each.file) != each.inode; }),
                     connections->end());
}

bool ConnectionAcceptor::HasRoom(int file, const std::string& address) {
  // The system gives the lowest number that is free, so that all below it are in use.
  if (file >= max_file_) {
    spdlog::warn("{}: a connection is closed: {} files are open already (max_connections)", address,
                 max_file_);
    return false;
  }
  if (by_address_.size() >= kManyAddresses)
    for (auto each = by_address_.begin(); each != by_address_.end();) {
      ForgetClosed(&each->second);
      each = each->second.empty() ? by_address_.erase(each) : std::next(each);
    }
  std::vector<Connection>& own = by_address_[address];
  if (own.size() >= max_per_address_) ForgetClosed(&own);
  if (own.size() >= max_per_address_) {
    spdlog::warn("{}: a connection is closed: it has {} already (max_connections_per_address)", address,
                 own.size());
    return false;
  }
  own.push_back({file, InodeOf(file)});
  return true;
}

}  // namespace touchstone::service
