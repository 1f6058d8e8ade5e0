// gRPC statuses and ours are the same codes under two names.
#pragma once

#include <absl/status/status.h>
#include <grpcpp/support/status.h>

namespace touchstone::client {

// The same code and message.
absl::Status FromGrpc(const grpc::Status& status);

// True if another try, at this server or another, may succeed without any change of the request.
bool IsLostServer(const absl::Status& status);

// The status of a call that nobody here cancels: then a server that was shut down did, and it is lost.
absl::Status LostWhereCancelled(const absl::Status& status);

// True if a limit of the server is used up by others, so that waiting helps; false if the request itself is too large.
bool IsFullServer(const absl::Status& status);

}  // namespace touchstone::client
