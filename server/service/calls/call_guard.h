// What a call on a source must still have, asked over and over while it is worked on.
#pragma once

#include <string>

#include <grpcpp/server_context.h>

#include "server/service/calls/lease_book.h"
#include "server/service/core/resources.h"
#include "server/source/motion_guard.h"

namespace touchstone::service {

// The client is still there, and where a lease is needed, the process is not draining and the lease holds. All must
// outlive the guard.
source::MotionGuard GuardOf(grpc::ServerContext* context, const Resources* resources, const LeaseBook* leases,
                            const std::string& lease_token);

// A call that only calculates has not taken longer than max_unary_s since the guard was made. What moves takes its time:
// ending it halfway helps nobody.
source::MotionGuard TimeGuardOf(const ServerOptions& options, bool moves);

// Both, and that nobody has called Control.Stop since the guard was made.
source::MotionGuard StoppableGuardOf(grpc::ServerContext* context, const Resources* resources,
                                     const LeaseBook* leases, const std::string& lease_token);

}  // namespace touchstone::service
