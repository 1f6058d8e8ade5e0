// touchstone rig status: how every part is.
#include <chrono>
#include <cmath>
#include <thread>

#include "client/cli/common/terminal.h"
#include "client/cli/rig/rig.h"
#include "client/source/dataset/lab_units.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"

namespace touchstone::cli {
namespace {

constexpr double kPartsPerMillion = 1e6;

struct StatusOptions {
  bool watch = false;
  double every_s = 1;
};

std::string Line(const std::string& name, const std::string& text) {
  std::string line = "  " + name;
  line.append(line.size() < 16 ? 16 - line.size() : 1, ' ');
  return line + text + "\n";
}

std::string Pose(const v1::BasePose& pose) {
  const auto three = [](const v1::Vector3& v, double factor) {
    const auto tenths = [factor](double value) {
      return Rounded(std::round(value * factor * 10) / 10 + 0.0);  // + 0.0: no -0
    };
    return absl::StrCat(tenths(v.x()), ", ", tenths(v.y()), ", ", tenths(v.z()));
  };
  return absl::StrCat(three(pose.position_m(), kMillimetresPerMetre), " mm; rotation ",
                      three(pose.rotation_rad(), 1 / kRadiansPerDegree), " deg");
}

std::string ArmText(const v1::ArmStatus& arm, const v1::RigLimits& limits) {
  std::string text = absl::StrCat("Arm           ", arm.model(), " at ", arm.address(),
                                  arm.connected() ? "" : ": NOT CONNECTED", "\n");
  if (!arm.connected()) return text;
  text += Line("Software", arm.version());
  text += Line("Mode", absl::StrCat(client::RobotModeWord(arm.robot_mode()), ", safety ",
                                    client::SafetyModeWord(arm.safety_mode()), ", speed ",
                                    Rounded(100 * arm.speed_scaling()), " %"));
  text += Line("Program", arm.program_id() == 0 ? "none yet"
                                                : absl::StrCat(arm.program_id(), ", phase ",
                                                               client::MotionPhaseWord(arm.phase())));
  text += Line("States", absl::StrCat(Rounded(arm.rate_hz()), " Hz, the newest is ",
                                      Rounded(kMillisecondsPerSecond * arm.state_age_s()), " ms old"));
  text += Line("Tip", Pose(arm.base_from_tip()));
  const v1::Vector3& force = arm.tip_force_n();
  text +=
      Line("Force", absl::StrCat(Rounded(std::round(10 * std::hypot(force.x(), force.y(), force.z())) / 10),
                                 " N on the tip; ", Rounded(limits.max_force_n()),
                                 " N beyond that at rest stop a motion"));
  text += Line("Kinematics", arm.calibrated_kinematics()
                                 ? "this arm's own calibration"
                                 : "as published of the model; the controller has not sent "
                                   "the arm's own (is port 30001 open?)");
  text +=
      Line("Clock", absl::StrCat("drift ", Rounded(kPartsPerMillion * arm.clock_drift()), " ppm, known to ",
                                 Rounded(kMicrosecondsPerSecond * arm.clock_uncertainty_s()), " us"));
  return text;
}

std::string EffectorText(const v1::EffectorStatus& effector) {
  std::string text =
      absl::StrCat("End effector  ", effector.port(), effector.connected() ? "" : ": NOT CONNECTED", "\n");
  if (!effector.connected()) return text;
  std::string pressed;
  for (int i = 0; i < effector.pressed_size(); ++i)
    if (effector.pressed(i)) absl::StrAppend(&pressed, pressed.empty() ? "" : ", ", i);
  text += Line("Firmware", effector.firmware());
  text += Line("Fingers", absl::StrCat(effector.fingers(),
                                       pressed.empty() ? ", none pressed" : ", PRESSED: " + pressed));
  text += Line("Clock",
               absl::StrCat("drift ", Rounded(kPartsPerMillion * effector.clock_drift()), " +- ",
                            Rounded(kPartsPerMillion * effector.clock_drift_uncertainty()), " ppm, known to ",
                            Rounded(kMicrosecondsPerSecond * effector.clock_uncertainty_s()), " us; ",
                            Counted(effector.round_trips(), "round trip", "round trips"), ", shortest ",
                            Rounded(kMillisecondsPerSecond * effector.shortest_round_trip_s()), " ms"));
  text += Line("Line", absl::StrCat(Counted(effector.bad_frames(), "bad frame", "bad frames"), ", ",
                                    Counted(effector.repeated_events(), "repeated event", "repeated events"),
                                    ", ", Counted(effector.reconnections(), "reconnection", "reconnections"),
                                    effector.bad_frames() + effector.repeated_events() > 0
                                        ? "; all were detected and repeated"
                                        : ""));
  return text;
}

std::string StateText(const v1::RigState& rig, const v1::State& state) {
  std::string text = absl::StrCat(
      "State         ", client::SourceStateWord(state.state()), ", ",
      state.lease_holder().empty() ? "no lease is held" : state.lease_holder() + " holds the lease", "; ",
      Counted(state.touches(), "touch", "touches"), ", ", Counted(state.images(), "picture", "pictures"),
      " in ", DurationInWords(state.uptime_s()), "\n");
  if (!state.stop_reason().empty())
    text += Line("", Wrap(absl::StrCat("stopped ", state.stop_reason(),
                                       "; make sure that the rig may move, then touchstone rig reset"),
                          TextWidth(), 16));
  text += absl::StrCat("Object        ",
                       rig.object().empty() ? "what lies on the fixture is unknown (touchstone rig mount)"
                                            : absl::StrCat(rig.object(), " with its face ",
                                                           client::UpFaceWord(rig.up_face()), " up"),
                       rig.mounts_itself() ? "; the rig changes it by itself" : "", "\n");
  text += ArmText(rig.arm(), rig.limits()) + EffectorText(rig.effector());
  const v1::CameraStatus& camera = rig.camera();
  text += absl::StrCat(
      "Camera        ",
      camera.connected()
          ? absl::StrCat(camera.description(),
                         camera.width() > 0 ? absl::StrCat(", ", camera.width(), "x", camera.height()) : "",
                         ", ", Counted(camera.frames(), "picture", "pictures"), ", ", camera.stale_frames(),
                         " stale")
      : camera.description().empty() ? "none"
                                     : camera.description() + ": NOT CONNECTED",
      "\n");
  if (rig.recovered_touches() + rig.interrupted_touches() > 0)
    text += absl::StrCat("After an interruption: ", Counted(rig.recovered_touches(), "touch", "touches"),
                         " recovered, ", rig.interrupted_touches(), " not\n");
  if (!rig.last_error().empty()) text += "Last error    " + Wrap(rig.last_error(), TextWidth(), 14) + "\n";
  if (rig.time_scale() != 0 && rig.time_scale() != 1)
    text += absl::StrCat("Time          ", Rounded(rig.time_scale()),
                         " rig seconds in one second: an emulator; nothing here is measured\n");
  if (!rig.safety_notice().empty()) text += "\n" + Wrap(rig.safety_notice(), TextWidth(), 0) + "\n";
  return text;
}

absl::Status PrintState(const Cli& cli, client::Connection* connection) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState rig, GetRig(connection));
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::State state,
                              connection->Call(&v1::Control::Stub::GetState, v1::GetStateRequest()));
  if (!cli.output().json) return cli.Print(StateText(rig, state));
  TOUCHSTONE_ASSIGN_OR_RETURN(Json json, RigJson(state, rig));
  // The words that people read elsewhere, instead of the enums' names.
  json["state"]["state"] = client::SourceStateWord(state.state());
  json["rig"]["up_face"] = client::UpFaceWord(rig.up_face());
  if (rig.has_arm()) {
    Json& arm = json["rig"]["arm"];
    arm["robot_mode"] = client::RobotModeWord(rig.arm().robot_mode());
    arm["safety_mode"] = client::SafetyModeWord(rig.arm().safety_mode());
    arm["phase"] = client::MotionPhaseWord(rig.arm().phase());
  }
  if (rig.has_camera()) json["rig"]["camera"]["kind"] = client::CameraKindWord(rig.camera().kind());
  PrintJson(json);
  return absl::OkStatus();
}

absl::Status RunStatus(const Cli& cli, const StatusOptions& options) {
  if (!(options.every_s > 0) || options.every_s > 3600)
    return absl::InvalidArgumentError(absl::StrCat("--every-s: ", ShortestNumber(options.every_s),
                                                   " is out of range; above 0, at most 3600"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const RigConnection rig, ConnectToRig(cli));
  while (true) {
    TOUCHSTONE_RETURN_IF_ERROR(PrintState(cli, rig.connection.get()));
    if (!options.watch) return absl::OkStatus();
    std::printf("\n");
    std::fflush(stdout);
    // Ctrl-C ends the process: nothing is under way here.
    std::this_thread::sleep_for(std::chrono::duration<double>(options.every_s));
  }
}

}  // namespace

void AddRigStatus(Cli* cli, CLI::App* group) {
  auto options = std::make_shared<StatusOptions>();
  CLI::App* command =
      cli->AddCommand(group, "status", "Shows the state of every part of the rig. Needs no lease.",
                      "touchstone rig status --server 127.0.0.1:50052\n"
                      "touchstone rig status --watch --server 127.0.0.1:50052\n"
                      "touchstone rig status --json --server 127.0.0.1:50052     SI units, as on the wire",
                      [cli, options] { return RunStatus(*cli, *options); });
  command->add_flag("--watch", options->watch, "Again and again, until Ctrl-C");
  command->add_option("--every-s", options->every_s, "With --watch: how often. Default: 1")->type_name("S");
  cli->AddRigOptions(command);
}

}  // namespace touchstone::cli
