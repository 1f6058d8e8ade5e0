#include "server/service/connections/relayed_peer.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/strip.h>
#include <unistd.h>

namespace touchstone::service {

std::string RelayedPeerName(uint64_t number, absl::string_view peer) {
  return absl::StrCat("touchstone/", ::getpid(), ".", number, "/", peer);
}

std::string PeerOf(const grpc::ServerContext& context) {
  return PeerOfTransport(context.peer());
}

std::string PeerOfTransport(absl::string_view peer) {
  if (!absl::ConsumePrefix(&peer, "unix-abstract:touchstone/")) return std::string(peer);
  return std::string(peer.substr(peer.find('/') + 1));
}

}  // namespace touchstone::service
