#include "client/cli/motion_options.h"

#include <poll.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>

#include "client/source/touch_ids.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

constexpr int kLookForInterruptMs = 100;

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
  TOUCHSTONE_ASSIGN_OR_RETURN(auto source, client::LeasedSource::Open(connection, std::move(options)));
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
          absl::StrCat("a person is needed (", what, "), but nobody answers: stdin has ended"));
    }
  }
  return absl::OkStatus();
}

std::string DurationInWords(double seconds) {
  const auto whole = static_cast<long long>(std::ceil(std::max(seconds, 0.0)));
  if (whole < 60) return absl::StrCat(whole, " s");
  if (whole < 3600) return absl::StrCat(whole / 60, " min ", whole % 60, " s");
  return absl::StrCat(whole / 3600, " h ", whole % 3600 / 60, " min");
}

}  // namespace touchstone::cli
