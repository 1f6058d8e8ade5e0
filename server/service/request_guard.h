// Looks at a request before it is decoded: its size, what it would become, and whether there is memory for it.
#pragma once

#include <grpcpp/impl/service_type.h>

#include "server/service/admission.h"
#include "server/service/limits.h"

namespace touchstone::service {

// Every method of the service that takes one message is asked for through the guard from now on. RESOURCE_EXHAUSTED names
// the limit. Before the service is registered. `limits`, `memory` and `rate` must outlive the service. Calls of Control, Rig
// and Freedrive are never refused for want of memory, nor counted: a stop always comes through. Other unary ones are counted.
void GuardRequests(grpc::Service* service, const Limits* limits, MemoryBudget* memory, CallRate* rate);

}  // namespace touchstone::service
