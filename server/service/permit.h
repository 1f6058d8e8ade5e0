// What a call on a rig must still have, asked over and over while something moves for it.
#pragma once

#include <string>

#include <grpcpp/server_context.h>

#include "server/service/lease_book.h"
#include "server/service/resources.h"
#include "server/source/rig_device.h"

namespace touchstone {

// The client is still there, the process is not draining, the lease holds. All must outlive the guard.
MotionGuard GuardOf(grpc::ServerContext* context, const Resources* resources, const LeaseBook* leases,
                    const std::string& lease_token);

}  // namespace touchstone
