#include "client/source/errors.h"

namespace touchstone::client {

absl::Status FromGrpc(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  return absl::Status(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
}

bool IsLostServer(const absl::Status& status) {
  return absl::IsUnavailable(status);
}

}  // namespace touchstone::client
