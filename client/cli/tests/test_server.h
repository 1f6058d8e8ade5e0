// For tests that need a virtual source at an address: a server in this process, gone with the object.
#pragma once

#include <memory>
#include <string>

#include <absl/strings/str_cat.h>

#include "server/base/check.h"
#include "server/service/rpc/server.h"

namespace touchstone::cli {

class TestServer {
 public:
  explicit TestServer(service::ServerOptions options = {}) {
    options.listen = "127.0.0.1:0";
    auto server = service::Server::Start(std::move(options));
    TOUCHSTONE_CHECK(server.ok());
    server_ = *std::move(server);
  }

  std::string address() const { return absl::StrCat("127.0.0.1:", server_->port()); }

 private:
  std::unique_ptr<service::Server> server_;
};

}  // namespace touchstone::cli
