// For tests that run the real binary, which lies beside them, in a folder of their own.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "server/base/files/file_writer.h"
#include "server/base/test_folder.h"
#include "server/base/text/text.h"

namespace touchstone::cli {

struct Outcome {
  int exit_code = -1;  // 128 + signal if one ended it
  std::string out, err;
};

// Model files of a rig with three fingers and nothing but noise: 5 ms, as rigs usually have, and 2 ms.
inline constexpr char kNominalModelFile[] =
    "touchstone: model/1\nname: nominal\nend_effector: {fingers: 3, spacing_mm: 30}\n"
    "effects:\n  - gaussian_noise: {sigma_us: 5000}\n";
inline constexpr char kQuietModelFile[] =
    "touchstone: model/1\nname: nominal\nend_effector: {fingers: 3, spacing_mm: 30}\n"
    "effects:\n  - gaussian_noise: {sigma_us: 2000}\n";

class RealBinaryTest : public ::testing::Test {
 protected:
  std::string Path(const std::string& name) const { return folder_.Path(name); }

  // TOUCHSTONE_SERVER of what is started from now on; empty: it is not set.
  void SetServerVariable(const std::string& value) { server_variable_ = value; }

  // Starts touchstone in the test's folder, its output in files.
  pid_t Start(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(),
                     std::filesystem::read_symlink("/proc/self/exe").parent_path() / "touchstone");
    const pid_t child = ::fork();
    if (child != 0) return child;
    if (server_variable_.empty())
      ::unsetenv("TOUCHSTONE_SERVER");
    else
      ::setenv("TOUCHSTONE_SERVER", server_variable_.c_str(), 1);
    if (::chdir(folder_.path().c_str()) != 0) ::_exit(99);
    for (const auto& [descriptor, name] : {std::pair{1, ".out"}, std::pair{2, ".err"}}) {
      const int file = ::open(name, O_WRONLY | O_CREAT | O_TRUNC, 0666);
      ::dup2(file, descriptor);
    }
    std::vector<char*> raw;
    for (std::string& argument : arguments) raw.push_back(argument.data());
    raw.push_back(nullptr);
    ::execv(raw[0], raw.data());
    ::_exit(98);
  }

  // Whether Wait would return at once.
  static bool HasEnded(pid_t child) {
    siginfo_t found{};
    return ::waitid(P_PID, child, &found, WEXITED | WNOHANG | WNOWAIT) == 0 && found.si_pid == child;
  }

  // Whether the program has a handler for the signal by now.
  static bool Catches(pid_t child, int signal) {
    std::ifstream status("/proc/" + std::to_string(child) + "/status");
    for (std::string line; std::getline(status, line);)
      if (line.rfind("SigCgt:", 0) == 0)
        return (std::stoull(line.substr(7), nullptr, 16) >> (signal - 1) & 1) != 0;
    return false;
  }

  // Processor time that the program has taken, in seconds.
  static double ProcessorTimeS(pid_t child) {
    std::ifstream stat("/proc/" + std::to_string(child) + "/stat");
    std::string text((std::istreambuf_iterator<char>(stat)), std::istreambuf_iterator<char>());
    std::istringstream fields(text.substr(std::min(text.size(), text.rfind(')') + 2)));  // behind the name
    std::string skipped;
    for (int k = 0; k < 11; ++k) fields >> skipped;
    double user = 0, system = 0;
    fields >> user >> system;
    return (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  }

  Outcome Wait(pid_t child) {
    int status = 0;
    ::waitpid(child, &status, 0);
    Outcome outcome;
    outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    outcome.out = ReadFile(Path(".out")).value_or("");
    outcome.err = ReadFile(Path(".err")).value_or("");
    return outcome;
  }

  Outcome Run(std::vector<std::string> arguments) { return Wait(Start(std::move(arguments))); }

  void Write(const std::string& name, const std::string& text) {
    ASSERT_TRUE(WriteFileAtomically(Path(name), text).ok());
  }
  std::string Read(const std::string& name) { return ReadFile(Path(name)).value_or(""); }

 private:
  TestFolder folder_;
  std::string server_variable_;
};

}  // namespace touchstone::cli
