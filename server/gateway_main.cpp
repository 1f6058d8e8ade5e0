// touchstone-gateway: the physical source as a process. Options come from flags and a TOML file; flags win.
#include <malloc.h>

#include "server/base/process/out_of_memory.h"
#include "server/service/gateway/gateway_server.h"
#include "server/service/rpc/process.h"

int main(int argc, char** argv) {
  using namespace touchstone;
  // Not one for each of the server's threads, in each of which a touch sooner or later leaves its pages.
  mallopt(M_ARENA_MAX, 2);
  return RunWithinMemory("touchstone-gateway", service::kExitOutOfMemory, [&] {
    return service::RunServer(
        "touchstone-gateway", service::ParseGatewayFlags(argc, argv),
        [](const service::GatewayFlags& flags) { return flags.options.common; },
        "what moves is stopped; draining",
        [](const service::GatewayFlags& flags) { return service::GatewayServer::Start(flags.options); });
  });
}
