// Calls of the page, forwarded byte by byte to a channel of gRPC: unary and server-streaming, of any method that grpc_web.h
// lets through. Knows no message.
#pragma once

#include <memory>

#include "client/workbench_server/http/http_server.h"
#include "client/workbench_server/http/upstream.h"

namespace touchstone::workbench {

// Whether the request is gRPC-Web's: a POST of its content type.
bool IsGrpcWeb(const HttpRequest& request);

// The server that answered, as a header of the answer.
inline constexpr char kServerHeader[] = "x-touchstone-server";

// Answers the exchange; the call is cancelled where the browser goes. A call whose server is lost before it has said anything
// is made again at the next server; one that is lost later ends with UNAVAILABLE. Returns at once.
void ForwardCall(std::shared_ptr<Upstream> upstream, std::shared_ptr<Exchange> exchange);

}  // namespace touchstone::workbench
