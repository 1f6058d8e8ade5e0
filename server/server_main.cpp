// touchstone-server: the virtual source as a process. Options come from flags and a TOML file; flags win.
#include "server/base/process/out_of_memory.h"
#include "server/service/rpc/process.h"
#include "server/service/rpc/server.h"
#include "server/service/rpc/server_flags.h"

int main(int argc, char** argv) {
  using namespace touchstone;
  return RunWithinMemory("touchstone-server", service::kExitOutOfMemory, [&] {
    return service::RunServer(
        "touchstone-server", service::ParseServerFlags(argc, argv),
        [](const service::ServerFlags& flags) { return flags.options; }, "draining",
        [](const service::ServerFlags& flags) { return service::Server::Start(flags.options); });
  });
}
