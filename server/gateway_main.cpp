// touchstone-gateway: the physical source as a process. Options come from flags and a TOML file; flags win.
#include <spdlog/spdlog.h>

#include <cstdio>
#include <string>

#include "server/service/gateway_server.h"
#include "server/service/process.h"

int main(int argc, char** argv) {
  using namespace touchstone;
  auto flags = ParseGatewayFlags(argc, argv);
  if (!flags.ok()) {
    std::fprintf(stderr, "touchstone-gateway: error: %s\n", std::string(flags.status().message()).c_str());
    return 2;
  }
  if (flags->done) return 0;
  SetUpLog(flags->log_level, flags->log_json);
  BlockSignals();

  auto gateway = GatewayServer::Start(flags->options);
  if (!gateway.ok()) {
    std::fprintf(stderr, "touchstone-gateway: error: %s\n", std::string(gateway.status().message()).c_str());
    return gateway.status().code() == absl::StatusCode::kUnavailable ? 3 : 2;
  }
  AnnounceListening(flags->options.common.listen, (*gateway)->port());
  const int signal = WaitForSignal();
  spdlog::info("signal {}: what moves is stopped; draining for up to {} s", signal,
               flags->options.common.drain_s);
  (*gateway)->Drain();
  spdlog::info("stopped");
  return 0;
}
