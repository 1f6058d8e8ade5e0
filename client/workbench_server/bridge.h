// Calls of the page, forwarded byte by byte to a channel of gRPC: unary and server-streaming, of any method that grpc_web.h
// lets through. Knows no message.
#pragma once

#include <memory>

#include <grpcpp/channel.h>

#include "client/workbench_server/http_server.h"

namespace touchstone::workbench {

// Whether the request is gRPC-Web's: a POST of its content type.
bool IsGrpcWeb(const HttpRequest& request);

// Answers the exchange; the call is cancelled where the browser goes. Returns at once.
void ForwardCall(std::shared_ptr<grpc::Channel> channel, std::shared_ptr<Exchange> exchange);

}  // namespace touchstone::workbench
