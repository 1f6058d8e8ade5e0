#include "server/gateway/rig/watches/run_command.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>

#include "server/base/text/text.h"

extern char** environ;

namespace touchstone::gateway {

absl::Status RunCommand(const std::vector<std::string>& arguments, double timeout_s,
                        const std::function<absl::Status()>& guard) {
  if (guard)
    if (absl::Status allowed = guard(); !allowed.ok()) return allowed;
  const std::string command = absl::StrJoin(arguments, " ");
  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);

  // Its signals are its own: this process may have blocked some. So is its process group: what it has started ends
  // with it.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETPGROUP);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&files, 2, 1);
  pid_t pid = 0;
  const int error = posix_spawnp(&pid, argv[0], &files, &attributes, argv.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&attributes);
  if (error != 0)
    return absl::FailedPreconditionError(
        absl::StrCat("'", command, "' cannot be run: ", std::strerror(error)));

  const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout_s);
  for (;;) {
    int status = 0;
    const pid_t ended = waitpid(pid, &status, WNOHANG);
    if (ended == pid) {
      if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return absl::OkStatus();
      return absl::FailedPreconditionError(
          WIFEXITED(status) ? absl::StrCat("'", command, "' ended with exit code ", WEXITSTATUS(status))
                            : absl::StrCat("'", command, "' was ended by signal ", WTERMSIG(status)));
    }
    absl::Status stop = guard ? guard() : absl::OkStatus();
    if (stop.ok() && std::chrono::steady_clock::now() > until)
      stop = absl::DeadlineExceededError(
          absl::StrCat("'", command, "' did not end within ", ShortestNumber(timeout_s), " s"));
    if (!stop.ok()) {
      kill(-pid, SIGKILL);
      waitpid(pid, &status, 0);
      return stop;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

}  // namespace touchstone::gateway
