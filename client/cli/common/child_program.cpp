#include "client/cli/common/child_program.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <thread>

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

#include "client/cli/common/interrupt.h"
#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kReadyWithin(60);
constexpr std::chrono::seconds kStopWithin(20);
constexpr std::chrono::milliseconds kLookEvery(20);
constexpr size_t kShownLines = 10;  // of a log, in an error

std::string EndOfLog(const std::string& log) {
  const absl::StatusOr<std::string> text = ReadFile(log);
  if (!text.ok()) return std::string(text.status().message());
  const std::vector<absl::string_view> lines = absl::StrSplit(*text, '\n', absl::SkipWhitespace());
  if (lines.empty()) return "it said nothing";
  return absl::StrJoin(lines.end() - std::min(lines.size(), kShownLines), lines.end(), "\n");
}

// What the new process does: only calls that are safe after fork in a program with threads.
[[noreturn]] void BecomeProgram(const char* path, char* const* arguments, const char* folder, int input,
                                int log, pid_t parent) {
  // A terminal's Ctrl-C is for the parent, which then asks its programs to end, once.
  ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::_exit(1);
  if (folder[0] != '\0' && ::chdir(folder) != 0) ::_exit(127);
  ::dup2(input, STDIN_FILENO);
  if (log >= 0) {
    ::dup2(log, STDOUT_FILENO);
    ::dup2(log, STDERR_FILENO);
  }
  ::execv(path, arguments);
  ::_exit(127);
}

}  // namespace

std::string PathBesideThisProgram(const std::string& name) {
  std::error_code error;
  return (fs::read_symlink("/proc/self/exe", error).parent_path() / name).string();
}

absl::StatusOr<std::string> PathOfProgram(const std::string& program) {
  std::error_code error;
  const auto runs = [&error](const fs::path& path) {
    return fs::is_regular_file(path, error) && ::access(path.c_str(), X_OK) == 0;
  };
  if (absl::StrContains(program, "/")) {
    if (runs(program)) return fs::absolute(program).string();
    return absl::NotFoundError(absl::StrCat(program, fs::exists(program, error)
                                                         ? ": is no executable file (chmod +x)"
                                                         : ": there is no such program"));
  }
  const char* const path = std::getenv("PATH");
  for (const absl::string_view folder : absl::StrSplit(path == nullptr ? "" : path, ':'))
    if (const fs::path at = fs::path(std::string(folder)) / program; runs(at))
      return fs::absolute(at).string();
  return absl::NotFoundError(
      absl::StrCat(program, ": no such program in PATH; of one in this folder say ./", program));
}

absl::StatusOr<std::unique_ptr<ChildProgram>> ChildProgram::Start(const std::string& name,
                                                                  const std::vector<std::string>& arguments,
                                                                  const std::string& log) {
  const std::string path = PathBesideThisProgram(name);
  if (::access(path.c_str(), X_OK) != 0)
    return absl::NotFoundError(
        absl::StrCat(path, " is needed and is not there; install all programs in one folder"));
  return StartAt(path, arguments, log, "");
}

absl::StatusOr<std::unique_ptr<ChildProgram>> ChildProgram::StartAt(const std::string& path,
                                                                    const std::vector<std::string>& arguments,
                                                                    const std::string& log,
                                                                    const std::string& folder) {
  const std::string name = fs::path(path).filename().string();
  std::vector<char*> words = {const_cast<char*>(name.c_str())};
  for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  const int input = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  const int output = log.empty() ? -1 : ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (!log.empty() && output < 0)
    return absl::FailedPreconditionError(absl::StrCat(log, ": cannot be written: ", std::strerror(errno)));
  const pid_t parent = ::getpid(), pid = ::fork();
  if (pid == 0) BecomeProgram(path.c_str(), words.data(), folder.c_str(), input, output, parent);
  ::close(input);
  if (output >= 0) ::close(output);
  if (pid < 0)
    return absl::ResourceExhaustedError(absl::StrCat(name, " cannot be started: ", std::strerror(errno)));
  return std::unique_ptr<ChildProgram>(new ChildProgram(name, log, pid));
}

ChildProgram::ChildProgram(std::string name, std::string log, pid_t pid)
    : name_(std::move(name)), log_(std::move(log)), pid_(pid) {}

ChildProgram::~ChildProgram() {
  Stop().IgnoreError();
}

bool ChildProgram::HasEnded() {
  if (!ended_) ended_ = ::waitpid(pid_, &end_, WNOHANG) == pid_;
  return ended_;
}

absl::Status ChildProgram::StatusOfEnd() const {
  if (WIFEXITED(end_) && WEXITSTATUS(end_) == 0) return absl::OkStatus();
  return absl::FailedPreconditionError(
      WIFEXITED(end_) ? absl::StrCat(name_, " ended with exit status ", WEXITSTATUS(end_))
                      : absl::StrCat(name_, " was ended by signal ", WTERMSIG(end_)));
}

absl::StatusOr<std::string> ChildProgram::WaitUntilReady(const std::string& ready) {
  const std::string before = ready + " ";
  const Clock::time_point until = Clock::now() + kReadyWithin;
  while (!Interrupt::Raised()) {
    const bool ended = HasEnded();
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(log_));
    const size_t at = text.find(before), line_end = text.find('\n', at);
    if (at != std::string::npos && line_end != std::string::npos) {
      const std::string line = text.substr(at + before.size(), line_end - at - before.size());
      return line.substr(0, line.find(' '));
    }
    if (ended || Clock::now() > until)
      return absl::UnavailableError(absl::StrCat(name_,
                                                 ended ? " ended before it was ready" : " is not ready",
                                                 "; the end of ", log_, ":\n", EndOfLog(log_)));
    std::this_thread::sleep_for(kLookEvery);
  }
  return absl::CancelledError("interrupted");
}

absl::Status ChildProgram::Wait() {
  bool asked = false;
  while (!HasEnded()) {
    if (Interrupt::Raised() && !asked) asked = ::kill(pid_, SIGTERM) == 0;
    std::this_thread::sleep_for(kLookEvery);
  }
  return asked ? absl::CancelledError("interrupted") : StatusOfEnd();
}

absl::StatusOr<int> ChildProgram::WaitForExit(double limit_s) {
  const Clock::time_point until =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(limit_s));
  while (!HasEnded() && !Interrupt::Raised() && Clock::now() < until) std::this_thread::sleep_for(kLookEvery);
  const bool in_time = HasEnded();
  ::kill(-pid_, SIGKILL);  // its group: what it has started
  if (!in_time) {
    Stop().IgnoreError();
    if (Interrupt::Raised()) return absl::CancelledError("interrupted");
    return absl::DeadlineExceededError(absl::StrCat(name_, " has not ended after ", limit_s, " s"));
  }
  if (WIFEXITED(end_)) return WEXITSTATUS(end_);
  return StatusOfEnd();
}

absl::Status ChildProgram::Stop() {
  if (!HasEnded()) ::kill(pid_, SIGTERM);
  const Clock::time_point until = Clock::now() + kStopWithin;
  while (!HasEnded()) {
    if (Clock::now() > until) ::kill(pid_, SIGKILL);
    std::this_thread::sleep_for(kLookEvery);
  }
  return StatusOfEnd();
}

}  // namespace touchstone::cli
