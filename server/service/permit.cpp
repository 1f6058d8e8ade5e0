#include "server/service/permit.h"

namespace touchstone {

MotionGuard GuardOf(grpc::ServerContext* context, const Resources* resources, const LeaseBook* leases,
                    const std::string& lease_token) {
  return [=]() -> absl::Status {
    if (context->IsCancelled())
      return absl::CancelledError("the client is gone, or the call's deadline has passed");
    if (resources->draining) return absl::UnavailableError("the gateway is being shut down");
    return leases->Check(lease_token);
  };
}

}  // namespace touchstone
