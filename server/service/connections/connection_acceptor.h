// Takes connections for a gRPC server, and no more than the process has files for. gRPC's own listener gives up for good
// when accept fails for want of a file, so that as many silent connections as there are files make it unreachable; this one
// closes what is too much and keeps a part of the files for everything else. Between the sockets and gRPC stands a relay
// that counts frames (connection_relay.h).
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <absl/status/statusor.h>
#include <grpcpp/server_builder.h>

#include "server/service/connections/connection_relay.h"
#include "server/service/connections/sparse_warning.h"
#include "server/service/connections/tls_port.h"
#include "server/service/options/limits.h"

namespace touchstone::service {

// The soft limit on open files becomes the hard one; what it is then.
uint64_t RaiseFileLimit();

class ConnectionAcceptor {
 public:
  // Listens at "HOST:PORT" (port 0: any free one, the same for every address of the host) without taking connections yet.
  // UNAVAILABLE names the address. `certificates`, which may be null for plain text, outlives it.
  static absl::StatusOr<std::unique_ptr<ConnectionAcceptor>> Listen(const std::string& address,
                                                                    const Limits& limits,
                                                                    ServerCertificates* certificates);
  ~ConnectionAcceptor();  // ends

  int port() const { return port_; }
  // Connections of an address beyond those that it or the process may have, for one call of Control.Stop each.
  static constexpr size_t kOnlyStopPerAddress = 8;

  // Hands every connection to `grpc_acceptor`, from threads of its own, when it has spoken.
  void Begin(std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> grpc_acceptor);
  // Takes none any more; those that there are go on. May be called again.
  void End();

 private:
  using Connections = std::vector<std::shared_ptr<RelayedConnection>>;
  struct Address {
    Connections connections;
    std::shared_ptr<FrameMeter::AddressCalls> calls = std::make_shared<FrameMeter::AddressCalls>(0);
  };

  ConnectionAcceptor(const Limits& limits, ServerCertificates* certificates);
  std::unique_ptr<Wire> WireOf(int file);  // null: it cannot be used
  absl::Status Open(const std::string& address);
  void Run();
  void Take(int listener);
  static void ForgetClosed(Connections* connections);
  // Null: all have calls.
  static RelayedConnection* LongestIdle(const Connections& connections, bool only_stop);
  // What there is room for: as any other, for a stop alone, or not at all.
  enum class Room { kNone, kStop, kAny };
  Room RoomFor(int file, const std::string& address);

  const Limits limits_;
  const size_t max_files_;
  const std::unique_ptr<TlsPort> tls_;  // null: plain text
  int port_ = 0;
  std::vector<int> listeners_;
  int wake_ = -1;  // an eventfd: ends the thread
  std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> grpc_acceptor_;
  std::map<std::string, Address> by_address_;  // of the thread
  SparseWarning full_;
  std::unique_ptr<ConnectionRelay> relay_;
  std::thread thread_;
};

}  // namespace touchstone::service
