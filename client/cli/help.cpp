// touchstone help, version, completion and man: what there is, from the table of commands itself.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <string>
#include <vector>

#include "client/cli/common/common.h"
#include "client/cli/completion.h"
#include "server/base/process/version.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/service/options/man_page.h"

namespace touchstone::cli {
namespace {

struct NamedCommand {
  const CLI::App* app;
  std::string above;  // "touchstone rig", of "rig run"
};

// The command of these words; none: touchstone itself.
absl::StatusOr<NamedCommand> FindCommand(const CLI::App& root, const std::vector<std::string>& words) {
  const CLI::App* app = &root;
  std::string above;
  for (const std::string& word : words) {
    std::vector<std::string> known;
    const CLI::App* next = nullptr;
    for (const CLI::App* command : app->get_subcommands({})) {
      known.push_back(command->get_name());
      if (command->get_name() == word) next = command;
    }
    absl::StrAppend(&above, above.empty() ? "" : " ", app->get_name());
    if (next == nullptr)
      return absl::InvalidArgumentError(
          known.empty() ? absl::StrCat("'", above, "' has no commands of its own; '", word, "' is too much")
                        : absl::StrCat("unknown command '", word, "'", DidYouMean(word, known)));
    app = next;
  }
  return NamedCommand{app, above};
}

absl::StatusOr<std::string> HelpOf(const Cli& cli, const std::vector<std::string>& words) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const NamedCommand command, FindCommand(cli.app(), words));
  absl::Status status;
  if (cli.Forward(command.app, {"--help"}, &status)) return status;
  // App::help() would be that of the command that runs.
  return command.app->get_formatter()->make_help(
      command.app, absl::StrCat(command.above, command.above.empty() ? "" : " ", command.app->get_name()),
      CLI::AppFormatMode::Normal);
}

absl::StatusOr<std::string> PageOf(const Cli& cli, const std::vector<std::string>& words) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const NamedCommand command, FindCommand(cli.app(), words));
  std::vector<std::string> called = {cli.app().get_name()}, others;
  called.insert(called.end(), words.begin(), words.end());
  // The page above, and from the first one those of the other programs.
  for (size_t above = 1; above < called.size(); ++above)
    others.push_back(absl::StrJoin(called.begin(), called.begin() + static_cast<std::ptrdiff_t>(above), "-"));
  if (words.empty())
    others = {"touchstone-server", "touchstone-gateway", "touchstone-probe", "touchstone-rig-emulator"};
  return service::ManPage(*command.app, called, others);
}

// "touchstone rig run" and all the others, one a line.
void AppendCommands(const CLI::App& app, const std::string& called, std::string* lines) {
  absl::StrAppend(lines, called, "\n");
  for (const CLI::App* command : app.get_subcommands({}))
    if (!command->get_group().empty())
      AppendCommands(*command, absl::StrCat(called, " ", command->get_name()), lines);
}

}  // namespace

void AddHelp(Cli* cli) {
  auto words = std::make_shared<std::vector<std::string>>();
  CLI::App* help =
      cli->AddCommand(nullptr, "help", "Prints the help of a command, or of all.",
                      "touchstone help\ntouchstone help rig run", [cli, words]() -> absl::Status {
                        const absl::StatusOr<std::string> text = HelpOf(*cli, *words);
                        return text.ok() ? cli->Print(*text) : text.status();
                      });
  help->add_option("COMMAND", *words, "Its name, word by word");
  cli->AddCommand(nullptr, "version", "Prints the version.", "touchstone version",
                  [cli] { return cli->Print(absl::StrCat("touchstone ", kVersion, "\n")); });
  auto shell = std::make_shared<std::string>();
  CLI::App* completion = cli->AddCommand(
      nullptr, "completion", "Prints what makes a shell complete commands and options.",
      "source <(touchstone completion bash)                    in ~/.bashrc\n"
      "source <(touchstone completion zsh)                     in ~/.zshrc\n"
      "touchstone completion fish | source                     in ~/.config/fish/config.fish",
      [cli, shell]() -> absl::Status {
        if (const auto known = OneOf("SHELL", *shell, {"bash", "zsh", "fish"}); !known.ok())
          return known.status();
        return cli->Print(*shell == "fish" ? FishCompletion(*cli) : CompletionScript(*cli, *shell == "zsh"));
      });
  completion->add_option("SHELL", *shell, "bash, zsh or fish")->required();
  // What the build makes manual pages of (cmake/documents.cmake); no user needs it.
  auto page = std::make_shared<std::vector<std::string>>();
  auto list = std::make_shared<bool>(false);
  CLI::App* man = cli->AddCommand(nullptr, "man", "Prints the manual page of a command in roff.",
                                  "touchstone man rig run | man -l -", [cli, page, list]() -> absl::Status {
                                    if (*list) {
                                      std::string lines;
                                      AppendCommands(cli->app(), cli->app().get_name(), &lines);
                                      return cli->Print(lines);
                                    }
                                    const absl::StatusOr<std::string> text = PageOf(*cli, *page);
                                    return text.ok() ? cli->Print(*text) : text.status();
                                  });
  man->add_option("COMMAND", *page, "Its name, word by word");
  man->add_flag("--list", *list, "Print how every command is called, instead");
  man->group("");
}

}  // namespace touchstone::cli
