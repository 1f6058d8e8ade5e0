// Where every connection over gRPC that this project makes begins: whether it may go through a proxy is decided here.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <grpcpp/channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/support/channel_arguments.h>
#include <grpcpp/support/client_interceptor.h>

namespace touchstone::service {

enum class ProxyUse {
  kByEnvironment,  // as ProxyFor says
  kNever,          // the server is this process, or one beside it
};

// The proxy through which gRPC reaches an address, in words: "the proxy http://proxy:3128 (https_proxy)"; empty where it
// needs none. The first of grpc_proxy, https_proxy and http_proxy that is set names it, if it is an http:// one; no_grpc_proxy
// or no_proxy lists the ends of names that need none; addresses of this machine, and its own name, never do. User and
// password are left out.
std::string ProxyFor(const std::string& address);

using Interceptors = std::vector<std::unique_ptr<grpc::experimental::ClientInterceptorFactoryInterface>>;

// The connection is made when it is first used.
std::shared_ptr<grpc::Channel> OpenChannel(const std::string& address,
                                           const std::shared_ptr<grpc::ChannelCredentials>& credentials,
                                           grpc::ChannelArguments arguments = {},
                                           Interceptors interceptors = {},
                                           ProxyUse proxy = ProxyUse::kByEnvironment);

}  // namespace touchstone::service
