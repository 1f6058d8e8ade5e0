#include "server/service/options/access_options.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/service/options/access_roles.h"
#include "server/service/options/option_table.h"

namespace touchstone::service {

std::vector<Option> AccessFlags(AccessOptions* options) {
  return {
      {"tls_cert", "Certificate of this server (PEM, with what leads to its CA); read again when it changes",
       &options->tls_cert},
      {"tls_key", "Its private key (PEM)", &options->tls_key},
      {"tls_client_ca", "CAs of client certificates (PEM): who has one may call", &options->tls_client_ca},
      {"token_file", "Who may call: lines that touchstone token new writes; read again when it changes",
       &options->token_file},
      {"client_cert_role",
       "Role of a client certificate that token_file does not list: reader, operator or admin",
       &options->client_cert_role},
      {"insecure",
       "Listen where other machines reach it without TLS or credentials: who reaches the port may do "
       "everything",
       &options->insecure},
  };
}

absl::Status CheckAccess(const std::string& listen, const AccessOptions& options) {
  if (options.tls_cert.empty() != options.tls_key.empty())
    return absl::InvalidArgumentError(absl::StrCat(
        options.tls_cert.empty() ? "tls_key is given without tls_cert" : "tls_cert is given without tls_key",
        ": TLS needs the certificate and its private key"));
  if (!options.tls_client_ca.empty() && !options.tls())
    return absl::InvalidArgumentError(
        "tls_client_ca is given without tls_cert and tls_key: client certificates are part of TLS");
  const absl::StatusOr<Role> role = ParseRole(options.client_cert_role);
  if (!role.ok())
    return absl::InvalidArgumentError(absl::StrCat("client_cert_role: ", role.status().message()));
  if (IsLocalAddress(listen) || options.insecure) return absl::OkStatus();
  std::string missing;
  if (!options.tls()) absl::StrAppend(&missing, " TLS (--tls-cert and --tls-key)");
  if (!options.asks())
    absl::StrAppend(&missing, missing.empty() ? "" : " and",
                    " credentials (--token-file or --tls-client-ca)");
  if (missing.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "listen = '", listen, "': other machines reach that address, so it needs", missing,
      "; or listen on 127.0.0.1; or give --insecure where whoever reaches the port may do everything"));
}

std::string InsecureWords(const std::string& listen, const AccessOptions& options) {
  if (IsLocalAddress(listen) || (options.tls() && options.asks())) return "";
  return absl::StrCat("insecure: ", listen, " is served ",
                      options.tls()    ? ""
                      : options.asks() ? "in plain text, tokens too"
                                       : "in plain text",
                      options.tls() || options.asks() ? "" : ", ",
                      options.asks() ? "" : "to whoever reaches it, with every right",
                      ". --tls-cert, --tls-key and --token-file would close that");
}

}  // namespace touchstone::service
