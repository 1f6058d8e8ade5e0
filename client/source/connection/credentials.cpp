#include "client/source/connection/credentials.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/support/client_interceptor.h>

#include <algorithm>
#include <cstdlib>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/service/channel/channel.h"
#include "server/service/channel/host_port.h"

namespace touchstone::client {
namespace {

constexpr uint64_t kMaxTokenBytes = 4096, kMaxPemBytes = 4 << 20;

absl::StatusOr<std::string> TokenOf(const Credentials& credentials) {
  std::string token = credentials.token;
  if (token.empty()) {
    absl::StatusOr<std::string> text = ReadFile(credentials.token_file, kMaxTokenBytes);
    if (!text.ok())
      return absl::InvalidArgumentError(absl::StrCat("--token-file: ", text.status().message()));
    token = std::string(absl::StripAsciiWhitespace(*text));
  }
  const bool visible = !token.empty() && std::all_of(token.begin(), token.end(), absl::ascii_isgraph);
  if (visible) return token;
  return absl::InvalidArgumentError(absl::StrCat(
      credentials.token.empty() ? absl::StrCat("--token-file ", credentials.token_file) : "the token",
      ": one word of visible characters was expected, as touchstone token new prints it"));
}

// Shows the token in a call's metadata. gRPC's own way to do so works over TLS only, and a server on this machine may ask
// for tokens without it.
class TokenInterceptor : public grpc::experimental::Interceptor {
 public:
  explicit TokenInterceptor(const Credentials* credentials) : credentials_(credentials) {}

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    using grpc::experimental::InterceptionHookPoints;
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_INITIAL_METADATA)) {
      // A file that has become unreadable: without a token the server says what is missing.
      const absl::StatusOr<std::string> token = TokenOf(*credentials_);
      if (token.ok()) methods->GetSendInitialMetadata()->insert({"authorization", "Bearer " + *token});
    }
    methods->Proceed();
  }

 private:
  const Credentials* const credentials_;
};

class TokenInterceptors : public grpc::experimental::ClientInterceptorFactoryInterface {
 public:
  explicit TokenInterceptors(Credentials credentials) : credentials_(std::move(credentials)) {}
  grpc::experimental::Interceptor* CreateClientInterceptor(grpc::experimental::ClientRpcInfo*) override {
    return new TokenInterceptor(&credentials_);
  }

 private:
  const Credentials credentials_;
};

absl::StatusOr<std::string> ReadPem(const char* option, const std::string& path) {
  absl::StatusOr<std::string> text = ReadFile(path, kMaxPemBytes);
  if (text.ok() && text->find("-----BEGIN ") != std::string::npos) return text;
  return absl::InvalidArgumentError(
      absl::StrCat(option, ": ",
                   text.ok() ? absl::StrCat(path, " is no PEM file") : std::string(text.status().message())));
}

absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> ChannelCredentialsOf(
    const Credentials& credentials) {
  if (credentials.tls_cert.empty() != credentials.tls_key.empty())
    return absl::InvalidArgumentError(
        "--tls-cert and --tls-key go together: a certificate and its private key");
  if (!credentials.tls()) {
    if (!credentials.tls_cert.empty())
      return absl::InvalidArgumentError(
          "--tls-cert needs --tls-ca FILE, or --tls-ca system: it is part of TLS");
    return grpc::InsecureChannelCredentials();
  }
  grpc::SslCredentialsOptions tls;
  if (credentials.tls_ca != "system") {
    TOUCHSTONE_ASSIGN_OR_RETURN(tls.pem_root_certs, ReadPem("--tls-ca", credentials.tls_ca));
  }
  if (!credentials.tls_cert.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(tls.pem_cert_chain, ReadPem("--tls-cert", credentials.tls_cert));
    TOUCHSTONE_ASSIGN_OR_RETURN(tls.pem_private_key, ReadPem("--tls-key", credentials.tls_key));
  }
  return grpc::SslCredentials(tls);
}

}  // namespace

Credentials WithEnvironment(Credentials credentials) {
  const auto fill = [](const char* name, std::string* value) {
    const char* const text = std::getenv(name);
    if (value->empty() && text != nullptr) *value = text;
  };
  fill("TOUCHSTONE_TLS_CA", &credentials.tls_ca);
  if (credentials.tls_cert.empty() && credentials.tls_key.empty()) {
    fill("TOUCHSTONE_TLS_CERT", &credentials.tls_cert);
    fill("TOUCHSTONE_TLS_KEY", &credentials.tls_key);
  }
  if (!credentials.token_file.empty()) return credentials;
  fill("TOUCHSTONE_TOKEN", &credentials.token);
  if (credentials.token.empty()) fill("TOUCHSTONE_TOKEN_FILE", &credentials.token_file);
  return credentials;
}

absl::StatusOr<std::shared_ptr<grpc::Channel>> MakeChannel(const std::string& address,
                                                           const Credentials& credentials,
                                                           const grpc::ChannelArguments& arguments) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto channel_credentials, ChannelCredentialsOf(credentials));
  service::Interceptors interceptors;
  if (!credentials.token.empty() || !credentials.token_file.empty()) {
    TOUCHSTONE_RETURN_IF_ERROR(TokenOf(credentials).status());
    if (!credentials.tls() && !service::IsLocalAddress(address))
      return absl::InvalidArgumentError(
          absl::StrCat("a token would go to ", address,
                       " in plain text, where others can read it: give the CA of the server's "
                       "certificate with --tls-ca FILE (or --tls-ca system), or leave the token out"));
    interceptors.push_back(std::make_unique<TokenInterceptors>(credentials));
  }
  return service::OpenChannel(address, channel_credentials, arguments, std::move(interceptors));
}

}  // namespace touchstone::client
