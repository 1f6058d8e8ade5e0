// Each call's id and its line in the log, and where it is counted.
#pragma once

#include <memory>
#include <string>

#include <absl/strings/string_view.h>
#include <grpcpp/support/server_interceptor.h>

namespace touchstone::service {

class CallMetrics;

// "OK", "CANCELLED", ...; "UNKNOWN" for what is no code of gRPC.
const char* StatusCodeName(int code);

// The trace id, 32 hexadecimal digits, of a traceparent header (https://www.w3.org/TR/trace-context/); "" if it is none.
std::string TraceIdOf(absl::string_view traceparent);

// Gives every call that is let in an id (the client's x-request-id, or a new one), which goes back to the client and, at log
// level debug, stands with the trace id, method, status and duration in the log. `metrics` may be null; it outlives the
// server.
std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> MakeCallInterceptors(
    CallMetrics* metrics);

}  // namespace touchstone::service
