// touchstone-server: the virtual source as a process. Options come from flags and a TOML file; flags win.
#include <spdlog/spdlog.h>

#include <cstdio>
#include <string>

#include "server/service/process.h"
#include "server/service/server.h"
#include "server/service/server_flags.h"

int main(int argc, char** argv) {
  using namespace touchstone;
  auto flags = ParseServerFlags(argc, argv);
  if (!flags.ok()) {
    std::fprintf(stderr, "touchstone-server: error: %s\n", std::string(flags.status().message()).c_str());
    return 2;
  }
  if (flags->done) return 0;
  SetUpLog(flags->log_level, flags->log_json);
  BlockSignals();

  auto server = Server::Start(flags->options);
  if (!server.ok()) {
    std::fprintf(stderr, "touchstone-server: error: %s\n", std::string(server.status().message()).c_str());
    return server.status().code() == absl::StatusCode::kUnavailable ? 3 : 2;
  }
  AnnounceListening(flags->options.listen, (*server)->port());
  const int signal = WaitForSignal();
  spdlog::info("signal {}: draining for up to {} s", signal, flags->options.drain_s);
  (*server)->Drain();
  spdlog::info("stopped");
  return 0;
}
