// touchstone rig stop|reset|power-on|home|mount.
#include "client/cli/rig/rig.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

constexpr std::chrono::seconds kStopAnswer{5};

struct MotionCommandOptions {
  MotionFlags motion;
  std::string reason, object, up_face = "+z";
};

const std::vector<std::string>& UpFaceNames() {
  static const std::vector<std::string> names = {"+x", "-x", "+y", "-y", "+z", "-z"};
  return names;
}

// As fast as it goes: no question before the call.
absl::Status RunStop(const Cli& cli, const MotionCommandOptions& options) {
  if (cli.source().servers.empty())
    return absl::InvalidArgumentError(
        "--server is missing: which rig is to stop? For instance --server 127.0.0.1:50052");
  // No waiting for a server that is starting: nothing moves there yet.
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, cli.ConnectNow());
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kStopAnswer);
  v1::StopRequest request;
  request.set_reason(options.reason);
  request.set_holder(client::LeaseHolder());
  v1::StopResponse response;
  const absl::Status status = client::FromGrpc(connection->control().Stop(&context, request, &response));
  if (!status.ok())
    return absl::Status(status.code(), absl::StrCat("THE STOP WAS NOT CONFIRMED: ", status.message(),
                                                    "; use the emergency stop if anything moves"));
  if (cli.output().json)
    PrintJson({{"aborted_touches", response.aborted_touches()}, {"standstill", response.standstill()}});
  if (!response.standstill())
    return absl::UnavailableError(
        absl::StrCat("THE STOP WAS SENT, BUT NOT CONFIRMED: ",
                     response.not_confirmed().empty()
                         ? "the gateway does not say whether the arm stands still; press the emergency "
                           "stop if anything moves"
                         : response.not_confirmed(),
                     ". It holds until somebody releases it: touchstone rig reset --reason TEXT"));
  const std::string aborted = Counted(response.aborted_touches(), "touch was", "touches were");
  // Asked afterwards: a stop waits for nothing.
  const auto source = connection->Call(&v1::Source::Stub::Describe, v1::DescribeRequest());
  if (source.ok() && source->kind() != v1::SOURCE_KIND_PHYSICAL)
    cli.Log(absl::StrCat("stopped; ", aborted, " under way. ", connection->address(), " is a ",
                         client::SourceKindName(source->kind()),
                         " source, which has no rig: nothing moves there, and nothing holds a stop"));
  else
    cli.Log(absl::StrCat("stopped, and nothing moves; ", aborted,
                         " under way. This is a software stop and not safety-rated. It holds until somebody "
                         "releases it: touchstone "
                         "rig reset --reason TEXT"));
  return absl::OkStatus();
}

absl::Status RunReset(const Cli& cli, const MotionCommandOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const RigConnection rig, ConnectToRig(cli));
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::State before,
                              rig.connection->Call(&v1::Control::Stub::GetState, v1::GetStateRequest()));
  v1::ResetRequest request;
  request.set_holder(client::LeaseHolder());
  request.set_reason(options.reason);
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::State state,
                              rig.connection->CallOnce(&v1::Control::Stub::Reset, request));
  const std::string word = client::SourceStateWord(state.state());
  if (cli.output().json) PrintJson({{"state", word}, {"released", before.stop_reason()}});
  cli.Log(before.stop_reason().empty()
              ? absl::StrCat("no stop held; the rig is ", word)
              : absl::StrCat("released: the rig was stopped ", before.stop_reason(), ". It is ", word,
                             " now; whoever moves it next acquires a new lease"));
  return absl::OkStatus();
}

void Report(const Cli& cli, const std::string& what, const v1::RigState& state) {
  if (cli.output().json)
    PrintJson({{"object", state.object()}, {"up_face", client::UpFaceWord(state.up_face())}});
  cli.Log(what);
}

absl::Status RunPowerOn(const Cli& cli, const MotionCommandOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const RigConnection rig, ConnectToRig(cli));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto source, OpenLeased(cli, rig.connection.get(), options.motion));
  const StopOnInterrupt stop_on_interrupt(source.get());
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState state, source->PowerOn());
  const std::string mode = client::RobotModeWord(state.arm().robot_mode());
  if (cli.output().json) PrintJson({{"robot_mode", mode}});
  cli.Log(absl::StrCat("the arm is powered on and its brakes are released: ", mode));
  return absl::OkStatus();
}

absl::Status RunHome(const Cli& cli, const MotionCommandOptions& options) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const RigConnection rig, ConnectToRig(cli));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto source, OpenLeased(cli, rig.connection.get(), options.motion));
  const StopOnInterrupt stop_on_interrupt(source.get());
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState state, source->Home());
  Report(cli, "the arm is at home", state);
  return absl::OkStatus();
}

absl::Status RunMount(const Cli& cli, const MotionCommandOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(OneOf("FACE", options.up_face, UpFaceNames()).status());
  TOUCHSTONE_ASSIGN_OR_RETURN(const RigConnection rig, ConnectToRig(cli));
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto source, OpenLeased(cli, rig.connection.get(), options.motion));
  const StopOnInterrupt stop_on_interrupt(source.get());
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::RigState state,
                              source->Mount(options.object, client::UpFaceOf(options.up_face)));
  Report(cli,
         absl::StrCat(state.mounts_itself() ? "the rig has put " : "noted: ", state.object(),
                      state.mounts_itself() ? " on the fixture" : " lies on the fixture", " with its face ",
                      client::UpFaceWord(state.up_face()), " up"),
         state);
  return absl::OkStatus();
}

}  // namespace

void AddRigMotions(Cli* cli, CLI::App* group) {
  auto options = std::make_shared<MotionCommandOptions>();
  const std::string server = " --server 127.0.0.1:50052";

  CLI::App* stop = cli->AddCommand(
      group, "stop", "Stops every motion now. Needs no lease and waits for nothing; not safety-rated.",
      "touchstone rig stop" + server + "\ntouchstone rig stop --reason 'cable caught'" + server,
      [cli, options] { return RunStop(*cli, *options); });
  stop->add_option("--reason", options->reason, "For the log")->type_name("TEXT");
  cli->AddRigOptions(stop);

  CLI::App* reset = cli->AddCommand(
      group, "reset",
      "Releases a stop, once you have made sure that the rig may move. Moves nothing and needs no lease, but "
      "ends the one that stands.",
      "touchstone rig reset --reason 'cable freed'" + server,
      [cli, options] { return RunReset(*cli, *options); });
  reset->add_option("--reason", options->reason, "Why it may move again, for the log")
      ->type_name("TEXT")
      ->required();
  cli->AddRigOptions(reset);

  CLI::App* power_on = cli->AddCommand(
      group, "power-on", "Powers the arm on and releases its brakes. Never unlocks a protective stop.",
      "touchstone rig power-on" + server, [cli, options] { return RunPowerOn(*cli, *options); });
  AddMotionOptions(power_on, &options->motion, false);
  cli->AddRigOptions(power_on);

  CLI::App* home =
      cli->AddCommand(group, "home", "Backs the tool out along its own axis and goes to the home joints.",
                      "touchstone rig home" + server, [cli, options] { return RunHome(*cli, *options); });
  AddMotionOptions(home, &options->motion, false);
  cli->AddRigOptions(home);

  CLI::App* mount = cli->AddCommand(
      group, "mount",
      "Tells which object lies on the fixture, and how. Where the rig changes it by itself, it does.",
      "touchstone rig mount lat20" + server + "\ntouchstone rig mount lat20 -x" + server +
          "     its face -x points up",
      [cli, options] { return RunMount(*cli, *options); });
  mount->add_option("OBJECT", options->object, "What lies on the fixture (touchstone objects)")
      ->type_name("")
      ->required();
  mount
      ->add_option(
          "FACE", options->up_face,
          "The face of its box that points up: +x, -x, +y, -y, +z (as in the mesh file) or -z. Default: +z")
      ->type_name("");
  // "-x" reads like an option; here it is a face.
  for (const char* face : {"-x", "-y", "-z"})
    mount->add_flag_callback(face, [options, face] { options->up_face = face; })->group("");
  AddMotionOptions(mount, &options->motion, false);
  cli->AddRigOptions(mount);
}

}  // namespace touchstone::cli
