#include "server/service/core/access_credentials.h"

#include <absl/strings/match.h>
#include <grpc/grpc.h>
#include <grpc/grpc_security.h>
#include <grpc/grpc_security_constants.h>
#include <grpcpp/support/slice.h>

#include "server/base/check.h"
#include "server/base/text/printable.h"
#include "server/service/connections/certificate_stamp.h"
#include "server/service/core/access.h"

namespace touchstone::service {
namespace {

absl::string_view ViewOf(const grpc_slice& slice) {
  return {reinterpret_cast<const char*>(GRPC_SLICE_START_PTR(slice)), GRPC_SLICE_LENGTH(slice)};
}

std::vector<std::string> PropertiesOf(const grpc_auth_context* context, const char* name) {
  std::vector<std::string> values;
  grpc_auth_property_iterator iterator = grpc_auth_context_find_properties_by_name(context, name);
  while (const grpc_auth_property* property = grpc_auth_property_iterator_next(&iterator))
    values.emplace_back(property->value, property->value_length);
  return values;
}

// Of every call, when its metadata have come and before its message is read.
void ProcessCall(void* access_of_port, grpc_auth_context* context, const grpc_metadata* metadata,
                 size_t count, grpc_process_auth_metadata_done_cb done, void* user_data) {
  Access* const access = static_cast<Access*>(access_of_port);
  ShownCredentials shown;
  std::string method;
  for (size_t i = 0; i < count; ++i) {
    const absl::string_view key = ViewOf(metadata[i].key);
    if (key == ":path") method = std::string(ViewOf(metadata[i].value));
    if (key == StampName()) shown.certificate_names = NamesOfStamp(ViewOf(metadata[i].value));
    if (key == "authorization") shown.authorization.emplace_back(ViewOf(metadata[i].value));
  }
  for (const char* property : {GRPC_X509_CN_PROPERTY_NAME, GRPC_X509_SAN_PROPERTY_NAME})
    for (std::string& name : PropertiesOf(context, property))
      shown.certificate_names.push_back(std::move(name));
  const absl::Status status = access->Authorize(method, shown);
  if (!status.ok()) access->LogRefusal(Printable(method, 200), status);
  done(user_data, nullptr, 0, nullptr, 0, static_cast<grpc_status_code>(status.code()),
       status.ok() ? nullptr : std::string(status.message()).c_str());
}

// Of every connection, before its handshake.
grpc_ssl_certificate_config_reload_status FetchCertificates(void* certificates,
                                                            grpc_ssl_server_certificate_config** config) {
  const std::optional<CertificateTexts> texts = static_cast<ServerCertificates*>(certificates)->TakeIfNew();
  if (!texts.has_value()) return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_UNCHANGED;
  const grpc_ssl_pem_key_cert_pair pair = {texts->key.c_str(), texts->certificate.c_str()};
  // gRPC 1.51 insists on some CA even where it asks for no certificate of a client; then none is verified with it.
  const std::string& ca = texts->client_ca.empty() ? texts->certificate : texts->client_ca;
  *config = grpc_ssl_server_certificate_config_create(ca.c_str(), &pair, 1);
  return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_NEW;
}

}  // namespace

void AccessCredentials::SetAuthMetadataProcessor(const std::shared_ptr<grpc::AuthMetadataProcessor>&) {
  TOUCHSTONE_CHECK(false);  // these have one of their own
}

int AccessCredentials::AddPortToServer(const std::string& address, grpc_server* server) {
  grpc_server_credentials* credentials = nullptr;
  // TLS of connections that are handed over has ended before (connection_acceptor.h).
  const bool plain = absl::StartsWith(address, "external:");
  if (ServerCertificates* const certificates = access_->certificates(); plain || certificates == nullptr) {
    credentials = grpc_insecure_server_credentials_create();
  } else {
    // Not required in the handshake: health checks come without, and who has a token needs none.
    credentials = grpc_ssl_server_credentials_create_with_options(
        grpc_ssl_server_credentials_create_options_using_config_fetcher(
            certificates->asks_clients() ? GRPC_SSL_REQUEST_CLIENT_CERTIFICATE_AND_VERIFY
                                         : GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE,
            FetchCertificates, certificates));
  }
  if (access_->asks())
    grpc_server_credentials_set_auth_metadata_processor(credentials, {ProcessCall, nullptr, access_});
  const int port = grpc_server_add_http2_port(server, address.c_str(), credentials);
  grpc_server_credentials_release(credentials);
  return port;
}

}  // namespace touchstone::service
