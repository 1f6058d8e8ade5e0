// Takes connections for a gRPC server, and no more than the process has files for. gRPC's own listener gives up for good
// when accept fails for want of a file, so that as many silent connections as there are files make it deaf; this one
// closes what is too much and keeps a part of the files for everything else.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <absl/status/statusor.h>
#include <grpcpp/server_builder.h>

#include "server/service/limits.h"

namespace touchstone::service {

// The soft limit on open files becomes the hard one; what it is then.
uint64_t RaiseFileLimit();

class ConnectionAcceptor {
 public:
  // Listens at "HOST:PORT" (port 0: any free one, the same for every address of the host) without taking connections yet.
  // UNAVAILABLE names the address.
  static absl::StatusOr<std::unique_ptr<ConnectionAcceptor>> Listen(const std::string& address,
                                                                    const Limits& limits);
  ~ConnectionAcceptor();  // ends

  int port() const { return port_; }
  // Hands every connection to `grpc_acceptor`, from a thread of its own.
  void Begin(std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> grpc_acceptor);
  // Takes none any more; those that there are go on. May be called again.
  void End();

 private:
  // A connection by its file and, since the number of a closed file comes again, the inode of its socket.
  struct Connection {
    int file = -1;
    uint64_t inode = 0;
  };

  explicit ConnectionAcceptor(const Limits& limits);
  absl::Status Open(const std::string& address);
  void Run();
  void Take(int listener);
  static void ForgetClosed(std::vector<Connection>* connections);
  bool HasRoom(int file, const std::string& address);

  const int max_file_;  // the first that is too much
  const size_t max_per_address_;
  int port_ = 0;
  std::vector<int> listeners_;
  int wake_ = -1;  // an eventfd: ends the thread
  std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> grpc_acceptor_;
  std::map<std::string, std::vector<Connection>> by_address_;  // of the thread
  std::thread thread_;
};

}  // namespace touchstone::service
