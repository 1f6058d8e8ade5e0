// The conformance tests against a physical source: a gateway that drives the emulated rig (--record DIR keeps
// its journal there), or one that serves that journal again (--replay DIR). The emulator's data stand for no
// measurement.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "server/service/gateway/gateway_server.h"
#include "tests/conformance/conformance.h"
#include "tests/rig/emulator.h"

namespace {

std::unique_ptr<touchstone::service::GatewayServer> StartGateway(std::vector<const char*> flags,
                                                                 const touchstone::Clock& clock) {
  flags.insert(flags.begin(),
               {"touchstone-gateway", "--listen", "127.0.0.1:0", "--supershape-triangles", "2000"});
  auto parsed = touchstone::service::ParseGatewayFlags(static_cast<int>(flags.size()), flags.data());
  if (parsed.ok()) {
    parsed->options.common.clock = &clock;
    parsed->options.common.max_unary_calls_per_s = 0;  // it stands still while the tests call
    auto gateway = touchstone::service::GatewayServer::Start(parsed->options);
    if (gateway.ok()) return *std::move(gateway);
    std::fprintf(stderr, "%s\n", std::string(gateway.status().message()).c_str());
  } else {
    std::fprintf(stderr, "%s\n", std::string(parsed.status().message()).c_str());
  }
  return nullptr;
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  const std::string mode = argc == 3 ? argv[1] : "";
  if (mode != "--record" && mode != "--replay") {
    std::fputs("--record DIR or --replay DIR would be right\n", stderr);
    return 2;
  }
  const std::filesystem::path folder = argv[2];
  touchstone::ManualClock clock;  // of the leases
  std::unique_ptr<touchstone::rig::Emulator> emulator;
  std::unique_ptr<touchstone::service::GatewayServer> gateway;
  if (mode == "--record") {
    // A busy machine, or one under sanitizers, must not pass for a broken rig: those have tests of their own.
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    touchstone::rig::EmulatorOptions options;
    options.dir = folder.string();
    options.speedup = 40;
    options.supershape_triangles = 2000;
    if (const char* arm = std::getenv("TOUCHSTONE_TEST_ARM")) options.arm = arm;  // ur3: a CB3 controller
    emulator = touchstone::rig::Emulator::Start(options);
    gateway = StartGateway({"--config", emulator->config_path().c_str(), "--arm-watchdog-hz", "0.5",
                            "--arm-silence-s", "5", "--effector-silence-s", "5"},
                           clock);
  } else {
    gateway = StartGateway({"--replay", (folder / "rig.db").c_str()}, clock);
  }
  if (gateway == nullptr) return 1;
  touchstone::SetConformanceTarget("127.0.0.1:" + std::to_string(gateway->port()), &clock);
  return RUN_ALL_TESTS();
}
