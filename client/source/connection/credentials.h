// What a client shows to a server, and the CA that it takes the server's certificate from.
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>
#include <grpcpp/channel.h>
#include <grpcpp/support/channel_arguments.h>

namespace touchstone::client {

struct Credentials {
  std::string tls_ca;             // PEM file, or "system" for this machine's CAs; empty: plain text
  std::string tls_cert, tls_key;  // PEM files: a client certificate, if the server takes them
  std::string token_file;         // read anew for every call, so that a token can be replaced meanwhile
  std::string token;              // itself; with it token_file is not read

  bool tls() const { return !tls_ca.empty(); }
};

// What is empty there from TOUCHSTONE_TLS_CA, TOUCHSTONE_TLS_CERT, TOUCHSTONE_TLS_KEY, TOUCHSTONE_TOKEN_FILE and
// TOUCHSTONE_TOKEN; the token's variables only where neither is given.
Credentials WithEnvironment(Credentials credentials);

// A channel that shows them with every call. INVALID_ARGUMENT: a file that cannot be read, a certificate without key or
// TLS, and a token that would cross a network in plain text. Messages never hold the token.
absl::StatusOr<std::shared_ptr<grpc::Channel>> MakeChannel(const std::string& address,
                                                           const Credentials& credentials,
                                                           const grpc::ChannelArguments& arguments);

}  // namespace touchstone::client
