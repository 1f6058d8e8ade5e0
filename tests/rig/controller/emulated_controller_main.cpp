// The emulated controller alone, for third-party clients: a test tool, no robot is moved.
//   touchstone-emulated-controller [--model=ur3e] [--address=127.0.0.77] [--speedup=1] [--any-port]
// It says which ports it listens on and ends when its standard input is closed.
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>

#include "tests/rig/controller.h"

int main(int argc, char** argv) {
  using namespace touchstone::rig;
  ControllerOptions options;
  options.powered = true;
  options.address = "127.0.0.77";
  options.dashboard_port = 29999;
  options.primary_port = 30001;
  options.secondary_port = 30002;
  options.realtime_port = 30003;
  options.rtde_port = 30004;
  options.primary_read_only_port = 30011;
  options.secondary_read_only_port = 30012;
  options.realtime_read_only_port = 30013;
  double speedup = 1;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const size_t equals = argument.find('=');
    const std::string name = argument.substr(0, equals),
                      value = equals == std::string::npos ? "" : argument.substr(equals + 1);
    if (name == "--model") {
      options.model = value;
    } else if (name == "--address") {
      options.address = value;
    } else if (name == "--speedup" && std::atof(value.c_str()) > 0) {
      speedup = std::atof(value.c_str());
    } else if (name == "--any-port") {
      options.dashboard_port = options.primary_port = options.secondary_port = options.rtde_port = 0;
      options.realtime_port = options.primary_read_only_port = 0;
      options.secondary_read_only_port = options.realtime_read_only_port = 0;
    } else {
      std::fprintf(stderr, "unknown argument '%s'\n", argument.c_str());
      return 2;
    }
  }
  try {
    SimClock clock(speedup);
    Faults faults;
    const auto controller = Controller::Start(options, &clock, &faults, nullptr);
    const auto ports = controller->ports();
    std::printf(
        "Emulated controller (a test tool) on %s: dashboard %d, primary %d, secondary %d, realtime %d, "
        "rtde %d\n",
        options.address.c_str(), ports.dashboard, ports.primary, ports.secondary, ports.realtime, ports.rtde);
    std::fflush(stdout);
    while (std::getchar() != EOF) {
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
