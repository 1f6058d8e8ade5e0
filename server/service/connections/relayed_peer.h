// Where a call comes from. gRPC is given a connection as one end of a pair of sockets (connection_relay.h), whose other end has
// the name "touchstone/PID.NUMBER/PEER": that is what gRPC calls its peer.
#pragma once

#include <cstdint>
#include <string>

#include <absl/strings/string_view.h>
#include <grpcpp/server_context.h>

namespace touchstone::service {

// The name of the relay's end, for a peer as gRPC writes it: "ipv4:10.0.0.7:4711".
std::string RelayedPeerName(uint64_t number, absl::string_view peer);

// "ipv4:10.0.0.7:4711".
std::string PeerOf(const grpc::ServerContext& context);
// The same of what gRPC calls a peer.
std::string PeerOfTransport(absl::string_view peer);

}  // namespace touchstone::service
