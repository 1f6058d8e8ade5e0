#include "client/cli/python_command.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include "client/cli/common/child_program.h"
#include "client/cli/common/common.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

constexpr char kPythonVariable[] = "TOUCHSTONE_PYTHON";

// What the interpreter runs: command, module and package, then the module's arguments. What is missing is what importing the
// package needs; a module says itself what it needs beyond that. Files of the folder at hand are no modules.
constexpr char kStart[] = R"py(
import signal, sys
signal.signal(signal.SIGTERM, signal.default_int_handler)
command, module, package = sys.argv[1:4]
sys.argv[:4] = [command]
if sys.path[:1] == ['']:
    del sys.path[0]
try:
    import importlib.util, runpy
    if importlib.util.find_spec(module) is None:
        raise ModuleNotFoundError(name=module)
    runpy.run_module(module, run_name='__main__', alter_sys=True)
except KeyboardInterrupt:
    sys.exit(130)
except ModuleNotFoundError as error:
    lacks = (error.name or '').split('.')[0]
    wanted = {'touchstone': package, 'grpc': 'grpcio', 'google': 'protobuf'}.get(lacks, lacks)
    print(f"touchstone: error: {command} needs the Python package {wanted}, which {sys.executable} lacks (no module "
          f"{error.name}). Install it with: {sys.executable} -m pip install '{wanted}'; or set TOUCHSTONE_PYTHON to a "
          'Python that has it', file=sys.stderr)
    sys.exit(4)
)py";

}  // namespace

const std::vector<PythonCommand>& PythonCommands() {
  static const std::vector<PythonCommand> commands = {
      {"export",
       "Writes a dataset or a session in a format of other tools: Parquet, LeRobot, WebDataset, HDF5, MCAP.",
       "touchstone.formats", "export", "touchstone-sim[formats]",
       "--to --out -o --force --json --quiet -q --help -h"},
      {"import", "Makes a measurement set of another tool's file: MCAP, ROS 2 bag, LeRobot, Parquet.",
       "touchstone.formats", "import", "touchstone-sim[formats]",
       "--map --out -o --list --force --json --quiet -q --help -h"},
      {"verify", "Reads a dataset, a session or a shard and says whether it is whole.", "touchstone.formats",
       "verify", "touchstone-sim[formats]", "--json --quiet -q --help -h"},
      {"recover", "Saves what is whole of a file that a kill or a full disk cut, and says what that is.",
       "touchstone.formats", "recover", "touchstone-sim[formats]",
       "--out -o --force --json --quiet -q --help -h"},
      {"worth", "Says what a better model is worth to your recogniser, on measured touches, with intervals.",
       "touchstone.training.worth", "", "touchstone-training",
       "--model --better --train --fitted --mesh --mesh-dir --server --samples --touches --poses --seeds "
       "--seed --figure --force --json --quiet -q --help -h"},
  };
  return commands;
}

absl::StatusOr<std::string> FindPython() {
  const char* named = std::getenv(kPythonVariable);
  if (named != nullptr && *named != '\0') {
    if (::access(named, X_OK) == 0) return std::string(named);
    return absl::NotFoundError(absl::StrCat(
        kPythonVariable, ": '", named, "' is no program; the path of a Python 3.9 or later was expected"));
  }
  const char* path = std::getenv("PATH");
  for (const absl::string_view folder : absl::StrSplit(path != nullptr ? path : "", ':', absl::SkipEmpty())) {
    const std::string file = absl::StrCat(folder, "/python3");
    if (::access(file.c_str(), X_OK) == 0) return file;
  }
  return absl::NotFoundError(absl::StrCat("python3 is not in PATH; install Python 3.9 or later, or set ",
                                          kPythonVariable, " to its path"));
}

absl::Status BecomePythonCommand(const PythonCommand& command, const std::vector<std::string>& arguments) {
  const absl::StatusOr<std::string> python = FindPython();
  if (!python.ok())
    return absl::Status(python.status().code(), absl::StrCat("touchstone ", command.name,
                                                             " runs in Python: ", python.status().message()));
  std::vector<std::string> words = {
      *python, "-c", kStart, absl::StrCat("touchstone ", command.name), command.module, command.package};
  for (const absl::string_view word : absl::StrSplit(command.first_words, ' ', absl::SkipEmpty()))
    words.emplace_back(word);
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> raw;
  for (std::string& word : words) raw.push_back(word.data());
  raw.push_back(nullptr);
  // Modules that need this program, to read a journal, find it there.
  ::setenv("TOUCHSTONE_PROGRAM", PathBesideThisProgram("touchstone").c_str(), /*overwrite=*/1);
  // A module that starts a server takes the one of this program.
  const std::string server = PathBesideThisProgram("touchstone-server");
  if (::access(server.c_str(), X_OK) == 0)
    ::setenv("TOUCHSTONE_SERVER_PROGRAM", server.c_str(), /*replace=*/0);
  std::fflush(stdout);
  ::execv(raw[0], raw.data());
  return absl::NotFoundError(absl::StrCat(*python, " cannot be started: ", std::strerror(errno)));
}

void AddPythonCommands(Cli* cli) {
  for (const PythonCommand& command : PythonCommands())
    cli->AddForwarded(command.name, command.description,
                      absl::StrSplit(command.options, ' ', absl::SkipEmpty()),
                      [&command](const std::vector<std::string>& arguments) {
                        return BecomePythonCommand(command, arguments);
                      });
}

}  // namespace touchstone::cli
