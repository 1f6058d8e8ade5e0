#include "client/cli/completion.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_replace.h>
#include <absl/strings/strip.h>

#include <set>
#include <vector>

namespace touchstone::cli {
namespace {

// Those that help lists.
std::vector<const CLI::App*> CommandsOf(const CLI::App& app) {
  std::vector<const CLI::App*> commands;
  for (const CLI::App* command : app.get_subcommands({}))
    if (!command->get_group().empty()) commands.push_back(command);
  return commands;
}

// One case per command: `path` is " rig run", and nothing for touchstone itself.
void AppendCases(const Cli& cli, const CLI::App& app, const std::string& path, std::string* cases) {
  std::vector<std::string> commands;
  for (const CLI::App* command : CommandsOf(app)) commands.push_back(command->get_name());
  absl::StrAppend(cases, "    '", path, "') commands='", absl::StrJoin(commands, " "), "' options='",
                  absl::StrJoin(cli.OptionsOf(&app), " "), "' ;;\n");
  for (const CLI::App* command : CommandsOf(app))
    AppendCases(cli, *command, absl::StrCat(path, " ", command->get_name()), cases);
}

// In single quotes.
std::string Quoted(const std::string& text) {
  return absl::StrCat("'", absl::StrReplaceAll(text, {{"\\", "\\\\"}, {"'", "\\'"}}), "'");
}

// `path` is " rig run", and nothing for touchstone itself.
void AppendFish(const Cli& cli, const CLI::App& app, const std::string& path, std::string* lines) {
  const std::vector<const CLI::App*> commands = CommandsOf(app);
  for (const CLI::App* command : commands)
    absl::StrAppend(
        lines, "complete -c touchstone -f -n '__touchstone_at --exactly", path, "' -a ", command->get_name(),
        " -d ", Quoted(command->get_description().substr(0, command->get_description().find(". "))), "\n");
  const std::string here = absl::StrCat("complete -c touchstone -n '__touchstone_at",
                                        commands.empty() ? "" : " --exactly", path, "'");
  std::set<std::string> described;
  for (const CLI::Option* option : app.get_options()) {
    std::string names;
    for (const std::string& name : option->get_lnames()) {
      absl::StrAppend(&names, " -l ", name);
      described.insert("--" + name);
    }
    for (const std::string& name : option->get_snames()) {
      absl::StrAppend(&names, " -s ", name);
      described.insert("-" + name);
    }
    if (names.empty()) continue;
    absl::StrAppend(lines, here, names, option->get_type_name().empty() ? "" : " -r", " -d ",
                    Quoted(option->get_description()), "\n");
  }
  // Of what another program does, only the names are known here.
  for (absl::string_view name : cli.OptionsOf(&app)) {
    if (described.count(std::string(name)) > 0) continue;
    const bool is_long = absl::ConsumePrefix(&name, "--");
    if (!is_long) absl::ConsumePrefix(&name, "-");
    absl::StrAppend(lines, here, is_long ? " -l " : " -s ", name, "\n");
  }
  for (const CLI::App* command : commands)
    AppendFish(cli, *command, absl::StrCat(path, " ", command->get_name()), lines);
}

}  // namespace

std::string CompletionScript(const Cli& cli, bool zsh) {
  std::string cases;
  AppendCases(cli, cli.app(), "", &cases);
  // As a file of a folder in zsh's fpath, its first line says for what; it is called then instead of being read.
  return absl::StrCat(
      zsh ? "#compdef touchstone\nautoload -U +X bashcompinit && bashcompinit\n" : "",
      R"(_touchstone_words() {
  commands='' options=''
  case "$1" in
)",
      cases, R"(  esac
}
_touchstone_complete() {
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
complete -o default -F _touchstone_complete touchstone
)",
      zsh ? "[[ \"${funcstack[1]}\" != _touchstone ]] || _bash_complete -o default -F _touchstone_complete\n"
          : "");
}

std::string FishCompletion(const Cli& cli) {
  std::string lines =
      R"(# Whether these are the words of the command so far: all of them with --exactly, else the first of them.
function __touchstone_at
    set -l exactly no
    if test "$argv[1]" = --exactly
        set exactly yes
        set -e argv[1]
    end
    set -l typed (string match --invert -- '-*' (commandline -opc))[2..]
    set -l wanted (count $argv)
    test (count $typed) -ge $wanted; or return 1
    test $exactly = no; or test (count $typed) -eq $wanted; or return 1
    test $wanted -eq 0; or test "$typed[1..$wanted]" = "$argv"
end
)";
  AppendFish(cli, cli.app(), "", &lines);
  return lines;
}

}  // namespace touchstone::cli
