// What every process does to serve: health checking, reflection, one port, limits of messages and connections, draining.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include "server/service/calls/call_queue.h"
#include "server/service/connections/connection_acceptor.h"
#include "server/service/core/access.h"
#include "server/service/core/metrics.h"
#include "server/service/options/server_options.h"
#include "server/service/rpc/control_service.h"

namespace touchstone::service {

struct ServedService {
  std::string name;  // "touchstone.v1.Source"
  grpc::Service* service;
};

struct Serving {
  std::unique_ptr<ConnectionAcceptor> acceptor;  // ends before the server; null: no port
  std::unique_ptr<grpc::Server> server;
  std::vector<std::unique_ptr<CallQueue>> queues;  // of Control
  int port = 0;

  // Ends whatever runs.
  void End();
};

// Errors name the option.
absl::Status CheckServing(const ServerOptions& options);
// INTERNAL if a method has no role (access_roles.h). `access` decides on every call, `calls` counts them
// if it is there; both outlive the server.
// `control` is one of the services; its calls wait for no others.
absl::StatusOr<Serving> StartServing(const ServerOptions& options, const std::vector<ServedService>& services,
                                     ControlService* control, Access* access, CallMetrics* calls);
// NOT_SERVING, no more calls, up to drain_s for running ones.
void StopServing(const ServerOptions& options, grpc::Server* server);

}  // namespace touchstone::service
