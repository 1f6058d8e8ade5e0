#include "server/service/calls/call_guard.h"

#include "server/base/status.h"
#include "server/base/text/over_limit.h"

namespace touchstone::service {

source::MotionGuard GuardOf(grpc::ServerContext* context, const Resources* resources, const LeaseBook* leases,
                            const std::string& lease_token) {
  return [=]() -> absl::Status {
    if (context->IsCancelled())
      return absl::CancelledError("the client is gone, or the call's deadline has passed");
    if (!leases->required()) return absl::OkStatus();
    if (resources->draining) return absl::UnavailableError("the gateway is being shut down");
    return leases->Check(lease_token);
  };
}

source::MotionGuard TimeGuardOf(const ServerOptions& options, bool moves) {
  return [moves, max_s = options.max_unary_s, clock = options.clock,
          begin = options.clock->Now()]() -> absl::Status {
    const double s = clock->SecondsSince(begin);
    return moves || s <= max_s
               ? absl::OkStatus()
               : OverLimit("the call is not done after seconds:", LimitInWords(s), "max_unary_s", max_s);
  };
}

source::MotionGuard StoppableGuardOf(grpc::ServerContext* context, const Resources* resources,
                                     const LeaseBook* leases, const std::string& lease_token) {
  return [resources, stops_before = resources->stop_count.load(),
          guard = GuardOf(context, resources, leases, lease_token),
          in_time = TimeGuardOf(resources->options, leases->required())]() -> absl::Status {
    TOUCHSTONE_RETURN_IF_ERROR(guard());
    TOUCHSTONE_RETURN_IF_ERROR(in_time());
    if (resources->stop_count != stops_before) return absl::AbortedError("stopped: Control.Stop was called");
    return absl::OkStatus();
  };
}

}  // namespace touchstone::service
