// TLS of a port, ended before gRPC so that the frames inside can be counted (connection_relay.h).
#pragma once

#include <memory>

#include <absl/status/status.h>

#include "server/service/connections/server_certificates.h"
#include "server/service/connections/wire.h"

struct ssl_ctx_st;

namespace touchstone::service {

// TLS 1.2 and later for HTTP/2. A client's certificate is asked for where there is a CA for it, verified if it is shown, and not
// required: health checks come without, and who has a token needs none.
class TlsPort {
 public:
  // `certificates` outlives it.
  explicit TlsPort(ServerCertificates* certificates) : certificates_(certificates) {}

  // The wire of a connection that has just been accepted, with the certificate as its files are now; null: they cannot be used.
  std::unique_ptr<Wire> Accept(int file);

 private:
  absl::Status Renew(const CertificateTexts& texts);

  ServerCertificates* const certificates_;
  std::shared_ptr<ssl_ctx_st> context_;
};

}  // namespace touchstone::service
