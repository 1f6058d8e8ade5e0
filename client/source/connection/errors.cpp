#include "client/source/connection/errors.h"

#include <absl/strings/match.h>

namespace touchstone::client {

absl::Status FromGrpc(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  // What gRPC itself answers where a service is not there comes without a word.
  if (status.error_code() == grpc::StatusCode::UNIMPLEMENTED && status.error_message().empty())
    return absl::UnimplementedError(
        "this source does not offer that: models, effects and diagnoses are a touchstone-server's, an arm's "
        "motions a rig's, through its touchstone-gateway; a recorded session has none of them");
  return absl::Status(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
}

bool IsLostServer(const absl::Status& status) {
  if (absl::IsUnavailable(status)) return true;
  // A killed server also shows as a stream that was reset.
  if (!absl::IsInternal(status) && !absl::IsUnknown(status)) return false;
  for (const char* words : {"RST_STREAM", "Stream removed", "Socket closed"})
    if (absl::StrContains(status.message(), words)) return true;
  return false;
}

absl::Status LostWhereCancelled(const absl::Status& status) {
  return absl::IsCancelled(status) ? absl::UnavailableError(status.message()) : status;
}

bool IsFullServer(const absl::Status& status) {
  return absl::IsResourceExhausted(status) && absl::StrContains(status.message(), "try again");
}

}  // namespace touchstone::client
