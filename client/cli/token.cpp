// touchstone token: makes what a server with --token-file asks for.
#include <absl/cleanup/cleanup.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

#include "client/cli/common/common.h"
#include "client/cli/common/output_file.h"
#include "server/base/files/file_writer.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/service/core/access_file.h"

namespace touchstone::cli {
namespace {

struct TokenOptions {
  std::string name, role, add_to, out;
};

constexpr mode_t kOwnerAlone = S_IRUSR | S_IWUSR;

// A token file stays one: what is wrong with it is said before it grows. A server that reads it meanwhile sees whole lines,
// since it is replaced as a whole; whoever adds another one at the same time waits.
absl::Status AddLine(const std::string& path, const std::string& line) {
  if (::access(path.c_str(), F_OK) != 0)
    return WriteOutputFile(path, line + "\n", /*force=*/false, kOwnerAlone);
  while (true) {
    const int file = OpenFile(path, O_RDONLY);
    if (file < 0) return FileError(errno, path, "cannot be opened");
    const auto close_at_end = absl::MakeCleanup([file] { ::close(file); });
    ::flock(file, LOCK_EX);
    struct stat locked {
    }, there{};
    if (::fstat(file, &locked) != 0 || ::stat(path.c_str(), &there) != 0)
      return FileError(errno, path, "cannot be examined");
    if (locked.st_ino != there.st_ino || locked.st_dev != there.st_dev) continue;  // replaced while we waited
    TOUCHSTONE_ASSIGN_OR_RETURN(std::string text, ReadFile(path, 1 << 20));
    TOUCHSTONE_RETURN_IF_ERROR(service::AccessFile::Parse(text, path).status());
    if (!text.empty() && text.back() != '\n') text += '\n';
    return WriteOutputFile(path, absl::StrCat(text, line, "\n"), /*force=*/true);
  }
}

absl::Status RunNew(const Cli& cli, const TokenOptions& options) {
  TOUCHSTONE_RETURN_IF_ERROR(service::CheckCallerName(options.name));
  const absl::StatusOr<service::Role> role = service::ParseRole(options.role);
  if (!role.ok()) return absl::InvalidArgumentError(absl::StrCat("--role: ", role.status().message()));
  const std::string token = service::NewAccessToken();
  const std::string line = absl::StrCat(options.name, " ", options.role, " ", service::HashOfToken(token));
  // The token first: a line without one would be of no use to anybody.
  const bool to_file = !options.out.empty() && !IsStandardOutput(options.out);
  if (to_file) {
    TOUCHSTONE_RETURN_IF_ERROR(WriteOutputFile(options.out, token + "\n", cli.output().force, kOwnerAlone));
  }
  if (!options.add_to.empty()) TOUCHSTONE_RETURN_IF_ERROR(AddLine(options.add_to, line));
  if (cli.output().json) {
    Json json = {{"name", options.name}, {"role", options.role}, {"line", line}};
    if (!to_file) json["token"] = token;
    PrintJson(json);
    return absl::OkStatus();
  }
  if (!to_file) std::printf("%s\n", token.c_str());
  cli.LogWritten(options.out, ", which its owner alone may read");
  if (options.add_to.empty())
    cli.Log(absl::StrCat("add to the server's token file: ", line));
  else
    cli.Log(absl::StrCat("added ", options.name, " as ", options.role, " to ", options.add_to,
                         "; a server that runs sees it with the next call"));
  return absl::OkStatus();
}

}  // namespace

void AddToken(Cli* cli) {
  CLI::App* group = cli->AddGroup("token", "Makes tokens for servers that ask who calls",
                                  "touchstone token new ana --role operator --add-to tokens -o ana.token");
  static TokenOptions options;
  CLI::App* command = cli->AddCommand(
      group, "new", "Makes a token: what a client shows, and the line by which a server knows it",
      "touchstone token new training --role reader --add-to tokens > training.token\n"
      "touchstone token new ana --role operator --add-to tokens -o ana.token\n"
      "touchstone token new ci --role admin                                    the line goes to stderr",
      [cli] { return RunNew(*cli, options); });
  command->add_option("NAME", options.name, "Who gets it, as logs and audits name them")->required();
  command
      ->add_option("--role", options.role,
                   "reader (streams, reads), operator (moves a rig) or admin (changes models and sessions)")
      ->required()
      ->type_name("ROLE");
  command
      ->add_option("--add-to", options.add_to,
                   "The server's --token-file: gets the line, with the token's hash")
      ->type_name("FILE");
  cli->AddOutput(command, "-o,--output", &options.out, "File for the token. Default: standard output");
}

}  // namespace touchstone::cli
