// Who may reach a server: what every process that listens can be told about it.
#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>

#include "server/service/channel/host_port.h"

namespace touchstone::service {

struct Option;

// Files are read again when they change.
struct AccessOptions {
  std::string tls_cert;                     // PEM: the server's certificate and what leads to its CA
  std::string tls_key;                      // PEM: its private key
  std::string tls_client_ca;                // PEM: the CAs of client certificates; empty: none are asked for
  std::string token_file;                   // access_file.h; empty: no tokens
  std::string client_cert_role = "reader";  // of a client certificate that token_file does not list
  bool insecure = false;                    // whoever reaches the port may call

  bool tls() const { return !tls_cert.empty(); }
  // Whether callers must say who they are.
  bool asks() const { return !token_file.empty() || !tls_client_ca.empty(); }
};

// Flags and keys of these.
std::vector<Option> AccessFlags(AccessOptions* options);

// That the options go together, and are enough for where the server listens. Errors say what is missing.
absl::Status CheckAccess(const std::string& listen, const AccessOptions& options);

// What is open to whom in spite of an address that others reach; empty if nothing is.
std::string InsecureWords(const std::string& listen, const AccessOptions& options);

}  // namespace touchstone::service
