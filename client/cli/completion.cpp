#include "client/cli/completion.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <vector>

namespace touchstone::cli {
namespace {

// One case per command: `path` is " rig run", and nothing for touchstone itself.
void AppendCases(const Cli& cli, const CLI::App& app, const std::string& path, std::string* cases) {
  std::vector<std::string> commands;
  for (const CLI::App* command : app.get_subcommands({})) commands.push_back(command->get_name());
  absl::StrAppend(cases, "    '", path, "') commands='", absl::StrJoin(commands, " "), "' options='",
                  absl::StrJoin(cli.OptionsOf(&app), " "), "' ;;\n");
  for (const CLI::App* command : app.get_subcommands({}))
    AppendCases(cli, *command, absl::StrCat(path, " ", command->get_name()), cases);
}

}  // namespace

std::string CompletionScript(const Cli& cli, bool zsh) {
  std::string cases;
  AppendCases(cli, cli.app(), "", &cases);
  return absl::StrCat(zsh ? "autoload -U +X bashcompinit && bashcompinit\n" : "",
                      R"(_touchstone_words() {
  commands='' options=''
  case "$1" in
)",
                      cases, R"(  esac
}
_touchstone() {
  local current="${COMP_WORDS[COMP_CWORD]}" path='' commands options i
  _touchstone_words ''
  for ((i = 1; i < COMP_CWORD; ++i)); do
    case " $commands " in
      *" ${COMP_WORDS[i]} "*) path="$path ${COMP_WORDS[i]}" && _touchstone_words "$path" ;;
    esac
  done
  case "$current" in
    -*) COMPREPLY=($(compgen -W "$options" -- "$current")) ;;
    *) COMPREPLY=($(compgen -W "$commands" -- "$current")) ;;
  esac
}
complete -o default -F _touchstone touchstone
)");
}

}  // namespace touchstone::cli
