// Programs that a command starts. They lie beside this one and end with it.
#pragma once

#include <sys/types.h>

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

namespace touchstone::cli {

// Path of the program of this name in the folder of this one; it need not be there.
std::string PathBesideThisProgram(const std::string& name);
// Absolute path of a program as a shell finds it: a path, or a name in PATH. NOT_FOUND if it is not there or not executable.
absl::StatusOr<std::string> PathOfProgram(const std::string& program);

class ChildProgram {
 public:
  // Its standard input is empty; what it prints is added to the file `log`, or goes where this process's output goes if
  // `log` is empty. NOT_FOUND if no such program lies beside this one.
  static absl::StatusOr<std::unique_ptr<ChildProgram>> Start(const std::string& name,
                                                             const std::vector<std::string>& arguments,
                                                             const std::string& log);
  // Another program, at `path`, in the folder `folder`. NOT_FOUND if it cannot be executed.
  static absl::StatusOr<std::unique_ptr<ChildProgram>> StartAt(const std::string& path,
                                                               const std::vector<std::string>& arguments,
                                                               const std::string& log,
                                                               const std::string& folder);
  ~ChildProgram();  // as Stop
  ChildProgram(const ChildProgram&) = delete;
  ChildProgram& operator=(const ChildProgram&) = delete;

  // The word behind `ready` in the log, as soon as it stands there ("listening on"). UNAVAILABLE with the end of the log if
  // the program ends before, or after a minute; CANCELLED once this process is interrupted.
  absl::StatusOr<std::string> WaitUntilReady(const std::string& ready);

  // Until it ends by itself, or is asked to since this process is interrupted. FAILED_PRECONDITION if its exit status is not
  // 0, CANCELLED after an interruption.
  absl::Status Wait();

  // The same, and how it ended: its exit status. DEADLINE_EXCEEDED after so many seconds, FAILED_PRECONDITION after a signal.
  // Then all that it has started is killed.
  absl::StatusOr<int> WaitForExit(double limit_s);

  // Asks it to end (SIGTERM) and waits; after 20 s it is killed. FAILED_PRECONDITION if its exit status is not 0.
  absl::Status Stop();

 private:
  ChildProgram(std::string name, std::string log, pid_t pid);
  bool HasEnded();
  absl::Status StatusOfEnd() const;

  std::string name_, log_;
  pid_t pid_;
  bool ended_ = false;
  int end_ = 0;  // of waitpid
};

}  // namespace touchstone::cli
