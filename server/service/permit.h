// What a call on a rig must still have, asked over and over while something moves for it.
#pragma once

#include <string>

#include <grpcpp/server_context.h>

#include "server/gateway/rig/physical_source.h"
#include "server/service/lease_book.h"
#include "server/service/resources.h"

namespace touchstone {

// The client is still there, the process is not draining, the lease holds. All must outlive the permit.
Permit PermitOf(grpc::ServerContext* context, const Resources* resources, const LeaseBook* leases,
                const std::string& lease_token);

}  // namespace touchstone
