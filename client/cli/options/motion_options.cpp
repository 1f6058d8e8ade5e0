#include "client/cli/options/motion_options.h"

#include <poll.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <thread>

#include "client/source/plans/touch_ids.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

constexpr int kLookForInterruptMs = 100;
constexpr std::chrono::milliseconds kLookAtRig{100};

// A gateway answers before its parts are connected: while it is starting they are waited for, as long as for the
// gateway itself. What is still missing then is said by the call that needs it.
absl::Status WaitForParts(const Cli& cli, client::Connection* connection,
                          const std::function<void(const std::string&)>& log) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(cli.source().wait_s);
  for (bool waiting = false;; waiting = true) {
    const absl::StatusOr<v1::RigState> rig = connection->Call(&v1::Rig::Stub::GetRig, v1::GetRigRequest());
    if (!rig.ok()) return absl::OkStatus();  // a source of another kind
    const bool arm = rig->arm().connected(), effector = rig->effector().connected();
    if ((arm && effector) || std::chrono::steady_clock::now() > end) return absl::OkStatus();
    if (Interrupt::Raised()) return absl::CancelledError("interrupted");
    if (!waiting)
      log(absl::StrCat("waiting for the rig's ",
                       arm        ? "end effector"
                       : effector ? "arm"
                                  : "arm and end effector",
                       ", up to ", cli.source().wait_s, " s"));
    std::this_thread::sleep_for(kLookAtRig);
  }
}

}  // namespace

void AddMotionOptions(CLI::App* command, MotionFlags* flags, bool session) {
  const char* group = "Physical source";
  command
      ->add_flag("--take-lease", flags->take_lease,
                 "Take the lease from whoever holds it; agree with them first")
      ->group(group);
  if (session)
    command
        ->add_option("--session", flags->session, "The session that journals the touches. Default: default")
        ->type_name("NAME")
        ->group(group);
}

absl::StatusOr<std::unique_ptr<client::LeasedSource>> OpenLeased(
    const Cli& cli, client::Connection* connection, const MotionFlags& flags,
    std::function<void(const std::string&)> log) {
  if (!flags.session.empty())
    TOUCHSTONE_RETURN_IF_ERROR(client::CheckSessionName(flags.session, "--session"));
  client::LeasedSourceOptions options;
  options.take_lease = flags.take_lease;
  options.log = log != nullptr ? std::move(log) : [&cli](const std::string& line) { cli.Log(line); };
  const std::function<void(const std::string&)> say = options.log;
  TOUCHSTONE_ASSIGN_OR_RETURN(auto source, client::LeasedSource::Open(connection, std::move(options)));
  if (source->physical()) TOUCHSTONE_RETURN_IF_ERROR(WaitForParts(cli, connection, say));
  if (source->lease()->required()) cli.Detail("holds the lease as " + client::LeaseHolder());
  return source;
}

absl::Status AskPerson(const std::string& what) {
  std::fflush(stdout);
  std::fprintf(stderr, "%s, then press Enter. ", what.c_str());
  std::fflush(stderr);
  for (char c = 0; c != '\n';) {
    pollfd input{STDIN_FILENO, POLLIN, 0};
    const int ready = ::poll(&input, 1, kLookForInterruptMs);
    if (Interrupt::Raised()) {
      std::fputc('\n', stderr);
      return absl::CancelledError("interrupted");
    }
    if (ready <= 0) continue;
    if (::read(STDIN_FILENO, &c, 1) <= 0) {
      std::fputc('\n', stderr);
      return absl::FailedPreconditionError(
          absl::StrCat("a person is needed (", what, "), but there is no answer: stdin has ended"));
    }
  }
  return absl::OkStatus();
}

}  // namespace touchstone::cli
