// touchstone-gateway: the physical source as a process. Options come from flags and a TOML file; flags win.
#include "server/service/gateway_server.h"
#include "server/service/process.h"

int main(int argc, char** argv) {
  using namespace touchstone;
  return RunServer(
      "touchstone-gateway", ParseGatewayFlags(argc, argv),
      [](const GatewayFlags& flags) { return flags.options.common; }, "what moves is stopped; draining",
      [](const GatewayFlags& flags) { return GatewayServer::Start(flags.options); });
}
