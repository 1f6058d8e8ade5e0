// touchstone-rig-emulator: a test tool that stands in for an arm, an end effector and a camera. What it
// reports was never measured on anything.
#include <chrono>
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "server/base/process/stop_signals.h"
#include "server/service/options/help_layout.h"
#include "server/service/options/man_page.h"
#include "tests/rig/emulator.h"
#include "tests/rig/emulator_commands.h"
#include "tests/rig/emulator_files.h"
#include "tests/rig/world/tcp_server.h"

namespace {

using touchstone::rig::EmulatorOptions;

constexpr double kAnswerS = 30;

// "name=value" of --fault.
std::pair<std::string, double> FaultOf(const std::string& text) {
  const size_t equals = text.find('=');
  size_t used = 0;
  double value = 0;
  try {
    value = std::stod(text.substr(equals == std::string::npos ? text.size() : equals + 1), &used);
  } catch (const std::exception&) {
  }
  if (equals == std::string::npos || used == 0 || equals + 1 + used != text.size())
    throw std::invalid_argument("--fault " + text + " must look like NAME=NUMBER, as in drop_bytes=0.01");
  return {text.substr(0, equals), value};
}

int Tell(const std::string& where, const std::vector<std::string>& words) {
  std::string line;
  for (const std::string& word : words) line += (line.empty() ? "" : " ") + word;
  const std::string answer = touchstone::rig::AskOnce(where, line, kAnswerS);
  std::printf("%s\n", answer.c_str());
  return answer.rfind("ok", 0) == 0 ? 0 : 1;
}

int Emulate(const EmulatorOptions& options) {
  touchstone::TakeStopSignals(touchstone::InheritedIgnore::kOverride);
  signal(SIGPIPE, SIG_IGN);

  const auto emulator = touchstone::rig::Emulator::Start(options);
  std::printf("ready %s\n", emulator->config_path().c_str());
  std::fflush(stdout);
  while (!emulator->QuitAsked()) {
    if (touchstone::WaitForStopSignal(std::chrono::milliseconds(100)) != 0) break;
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  EmulatorOptions options;
  options.dir = "emulated-rig";
  double jitter_ms = 0;
  std::vector<std::string> faults, words;
  std::string where;

  CLI::App app(
      std::string("touchstone-rig-emulator, ") + touchstone::rig::kNotice +
          ".\nAn emulated UR controller, the firmware's core behind a pseudo-terminal, and a camera, for "
          "tests "
          "of "
          "touchstone-gateway.\nPrints \"ready DIR/gateway.toml\" when everything listens; ends on SIGTERM.",
      "touchstone-rig-emulator");
  app.option_defaults()->always_capture_default();
  app.add_option("--dir", options.dir,
                 "Folder for gateway.toml, calibration.yaml, emulator.json, the log and the port");
  app.add_option("--arm", options.arm, "Arm to emulate")->check(CLI::IsMember({"ur3", "ur3e"}));
  app.add_flag("--powered,!--power-off", options.powered,
               "Whether the arm's power is on and its brakes are released at the beginning, as a person "
               "leaves them. Default: "
               "they are");
  app.add_option(
      "--hide", options.hide,
      "Hidden effect, EFFECT.PARAMETER=VALUE[,VALUE...]; names and units of the catalogue; of touches, or "
      "of the camera (tests/rig/README.md)");
  app.add_flag("!--no-camera", options.camera,
               "gateway.toml names no camera: touches are quicker where nobody watches");
  app.add_option("--camera-width", options.camera_width, "Of its pictures, pixels");
  app.add_option("--camera-height", options.camera_height, "Of its pictures, pixels");
  app.add_option("--jpeg-quality", options.jpeg_quality, "Of its pictures, 1 to 100");
  app.add_option("--unlisted", options.unlisted, "Hidden physics of no catalogue, NAME=K_MM[,SECOND]");
  app.add_option("--sigma-us", options.sigma_us, "Gaussian noise of each finger's time");
  app.add_option("--seed", options.seed, "Of noise, bumps, clocks and line faults");
  app.add_option("--mesh", options.meshes, "Object, NAME=FILE in mm; default: the five built-in supershapes");
  app.add_option("--supershape-triangles", options.supershape_triangles,
                 "Of each built-in supershape, about");
  app.add_option("--object", options.object, "Object that is mounted from the beginning; default: none");
  app.add_option("--up-face,--placement", options.up_face, "Its face that points up");
  app.add_option("--speedup", options.speedup, "Simulated seconds in one second");
  app.add_option("--fingers", options.fingers, "Number of fingers, 1 to 8");
  app.add_option("--spacing-mm", options.spacing_mm, "Between neighbouring fingers");
  app.add_option("--sensor", options.sensor, "Of the fingers")
      ->check(CLI::IsMember({"optical", "microswitch", "resistor"}));
  app.add_flag("--calibrated", options.calibrated,
               "The arm's kinematics have deltas of their own, as real arms have");
  app.add_option("--finger-give-mm", options.finger_give_mm,
                 "Pushed farther beyond a contact: protective stop");
  app.add_option("--drift-ppm", options.drift_ppm, "Of the device's oscillator");
  app.add_option("--jitter-ms", jitter_ms, "Delay of the serial line, uniform from 0; simulated time");
  app.add_flag("--pace-baud", options.pace_baud, "Bytes take their time at 115200 baud");
  app.add_flag("--unplug-resets", options.unplug_resets, "The device takes its power from the line");
  app.add_option("--fault", faults, "Fault from the beginning, NAME=VALUE; tests/rig/README.md lists them");
  app.add_option("--address", options.address, "Where to listen");
  app.add_option("--dashboard-port", options.dashboard_port, "0: any free one");
  app.add_option("--primary-port", options.primary_port, "0: any free one");
  app.add_option("--secondary-port", options.secondary_port, "0: any free one");
  app.add_option("--rtde-port", options.rtde_port, "0: any free one");
  app.add_option("--camera-port", options.camera_port, "0: any free one");
  app.add_option("--control-port", options.control_port, "0: any free one");
  auto* tell = app.add_subcommand(
      "tell", std::string("Tells a running emulator something: ") + touchstone::rig::kCommands);
  tell->add_option("where", where, "HOST:PORT of its control port (emulator.json)")->required();
  tell->add_option("words", words, "What to tell")->required();
  if (touchstone::service::PrintedManPage(app, argc, argv)) return 0;
  app.formatter(std::make_shared<touchstone::service::HelpLayout>());
  // Faces begin with a sign: these words are not searched for options.
  const bool telling = argc >= 4 && std::string(argv[1]) == "tell";
  if (telling) where = argv[2], words.assign(argv + 3, argv + argc);
  if (!telling) CLI11_PARSE(app, argc, argv);

  try {
    if (telling || tell->parsed()) return Tell(where, words);
    for (const std::string& fault : faults) options.faults.push_back(FaultOf(fault));
    if (jitter_ms != 0) options.faults.push_back({"line_delay_ms", jitter_ms});
    return Emulate(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "touchstone-rig-emulator: error: %s\n", error.what());
    return 2;
  }
}
