// Looks at a request before it is decoded: its size, what it would become, and whether there is memory for it.
#pragma once

#include <absl/status/statusor.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/zero_copy_stream.h>
#include <grpcpp/impl/service_type.h>

#include "server/service/core/admission.h"
#include "server/service/options/limits.h"

namespace touchstone::service {

// Every method of the service that takes one message is asked for through the guard from now on. RESOURCE_EXHAUSTED names
// the limit. Before the service is registered. `limits`, `memory` and `rate` must outlive the service. Calls of Control, Rig
// and Freedrive are never refused for want of memory, nor counted: a stop always comes through. Other unary ones are counted.
void GuardRequests(grpc::Service* service, const Limits* limits, MemoryBudget* memory, CallRate* rate);

// Bytes that a request of so many bytes will take when it is decoded, about. RESOURCE_EXHAUSTED names the limit. `large`: it
// may be as large as an upload.
absl::StatusOr<uint64_t> MeasureRequest(const google::protobuf::Descriptor& request, size_t bytes,
                                        google::protobuf::io::ZeroCopyInputStream* stream,
                                        const Limits& limits, bool large);

}  // namespace touchstone::service
