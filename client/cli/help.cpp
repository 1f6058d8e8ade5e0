// touchstone help, version and completion: what there is, from the table of commands itself.
#include <absl/strings/str_cat.h>

#include <string>
#include <vector>

#include "client/cli/common.h"
#include "client/cli/completion.h"
#include "server/base/text.h"
#include "server/base/version.h"

namespace touchstone::cli {
namespace {

// Of "rig run": that of the command below the one above it.
absl::StatusOr<std::string> HelpOf(const Cli& cli, const std::vector<std::string>& words) {
  const CLI::App* app = &cli.app();
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
  absl::Status status;
  if (cli.Forward(app, {"--help"}, &status)) return status;
  // App::help() would be that of the command that runs.
  return app->get_formatter()->make_help(app, absl::StrCat(above, above.empty() ? "" : " ", app->get_name()),
                                         CLI::AppFormatMode::Normal);
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
  CLI::App* completion =
      cli->AddCommand(nullptr, "completion", "Prints what makes a shell complete commands and options.",
                      "source <(touchstone completion bash)                    in ~/.bashrc\n"
                      "source <(touchstone completion zsh)                     in ~/.zshrc",
                      [cli, shell]() -> absl::Status {
                        if (const auto known = OneOf("SHELL", *shell, {"bash", "zsh"}); !known.ok())
                          return known.status();
                        return cli->Print(CompletionScript(*cli, *shell == "zsh"));
                      });
  completion->add_option("SHELL", *shell, "bash or zsh")->required();
}

}  // namespace touchstone::cli
