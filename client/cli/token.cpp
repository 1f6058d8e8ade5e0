// touchstone token: makes what a server with --token-file asks for.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "client/cli/common.h"
#include "server/base/new_file.h"
#include "server/base/status.h"
#include "server/base/text.h"
#include "server/service/access_file.h"

namespace touchstone::cli {
namespace {

struct TokenOptions {
  std::string name, role, add_to, out;
};

absl::Status CannotWrite(const std::string& path) {
  if (errno == EEXIST) return absl::InvalidArgumentError(absl::StrCat(path, " exists; --force replaces it"));
  return absl::InvalidArgumentError(absl::StrCat(path, ": ", std::strerror(errno)));
}

// In one write, so that a server that reads it meanwhile sees whole lines. Only its owner may read or write a new file.
absl::Status WriteOwnersFile(const std::string& path, const std::string& text, int flags) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | flags, S_IRUSR | S_IWUSR);
  if (file < 0) return CannotWrite(path);
  const bool written =
      ::write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && ::fsync(file) == 0;
  const absl::Status status = written ? absl::OkStatus() : CannotWrite(path);
  ::close(file);
  TOUCHSTONE_RETURN_IF_ERROR(status);
  return SyncFolderOf(path);
}

// A token file stays one: what is wrong with it is said before it grows.
absl::Status AddLine(const std::string& path, const std::string& line) {
  std::string start;
  if (::access(path.c_str(), F_OK) == 0) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(path, 1 << 20));
    TOUCHSTONE_RETURN_IF_ERROR(service::AccessFile::Parse(text, path).status());
    if (!text.empty() && text.back() != '\n') start = "\n";
  }
  return WriteOwnersFile(path, start + line + "\n", O_APPEND);
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
    if (cli.output().force) ::unlink(options.out.c_str());
    TOUCHSTONE_RETURN_IF_ERROR(WriteOwnersFile(options.out, token + "\n", O_EXCL));
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
