// The virtual source as one object: services, store, renderer and thread pool. touchstone-server gives it a
// port; the command line's embedded mode and tests talk to it through a channel inside the process, so that
// both run the very same code.
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>
#include <grpcpp/channel.h>

#include "server/service/options/server_options.h"

namespace touchstone::service {

class Server {
 public:
  // Reads meshes and models and listens. Errors name the option or the file.
  static absl::StatusOr<std::unique_ptr<Server>> Start(ServerOptions options);
  ~Server();

  // The port listened on; 0 without one.
  int port() const;

  // That of the counters and probes; 0 without one.
  int metrics_port() const;

  // A channel to this server without a socket.
  std::shared_ptr<grpc::Channel> InProcessChannel();

  // Takes no more calls, reports NOT_SERVING, waits up to drain_s for running ones, then cancels the rest.
  void Drain();

 private:
  Server();
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace touchstone::service
