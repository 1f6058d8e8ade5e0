// What gRPC asks at a port: who may connect, with which certificate, and whether a call may be made.
#pragma once

#include <memory>
#include <string>

#include <grpcpp/security/server_credentials.h>

namespace touchstone::service {

class Access;

// gRPC's own credentials in C++ can either change their certificates or decide on calls over plain text, but not both;
// its C interface, on which those stand, has all of it.
class AccessCredentials final : public grpc::ServerCredentials {
 public:
  // `access` outlives the server.
  explicit AccessCredentials(Access* access) : access_(access) {}
  void SetAuthMetadataProcessor(const std::shared_ptr<grpc::AuthMetadataProcessor>& processor) override;

 private:
  int AddPortToServer(const std::string& address, grpc_server* server) override;

  Access* const access_;
};

}  // namespace touchstone::service
