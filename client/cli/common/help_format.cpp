#include "client/cli/common/help_format.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_split.h>

#include <algorithm>

#include "client/cli/common/common.h"
#include "client/cli/common/terminal.h"
#include "server/service/options/help_layout.h"

namespace touchstone::cli {
namespace {

constexpr size_t kCommandColumn = 15;  // where the texts of commands begin: two after the longest name

// One line of what it is, then examples, then usage and options.
class HelpFormat : public service::HelpLayout {
 public:
  explicit HelpFormat(std::vector<std::string> examples) : examples_(std::move(examples)) {}

  std::string make_description(const CLI::App* app) const override {
    return absl::StrCat(Wrap(app->get_description(), TextWidth(), 0), "\n\nExamples:\n", Examples(), "\n");
  }

  // The first sentence is enough in a list of commands.
  std::string make_subcommand(const CLI::App* sub) const override {
    std::string line = sub->get_description();
    line = line.substr(0, line.find(". "));
    if (!line.empty() && line.back() == '.') line.pop_back();
    std::string text = "  " + sub->get_name();
    text.append(text.size() < kCommandColumn ? kCommandColumn - text.size() : 2, ' ');
    return text + Wrap(line, TextWidth(), text.size()) + "\n";
  }

 private:
  // One per line; as they are where nobody sees them on a terminal.
  std::string Examples() const {
    std::string text;
    // An example of several lines is one command.
    std::vector<std::string> examples;
    bool goes_on = false;
    for (const std::string& line : examples_) {
      if (goes_on && OnTerminal()) {
        examples.back().pop_back();
        absl::StrAppend(&examples.back(), absl::StripLeadingAsciiWhitespace(line));
      } else {
        examples.push_back(line);
      }
      goes_on = absl::EndsWith(line, "\\");
    }
    for (const std::string& line : examples)
      absl::StrAppend(&text, OnTerminal() ? service::FittedExample(line, static_cast<size_t>(TerminalWidth()))
                                          : "  " + line + "\n");
    return text;
  }

  std::vector<std::string> examples_;
};

}  // namespace

std::shared_ptr<CLI::FormatterBase> ExamplesFirst(const std::string& examples) {
  return std::make_shared<HelpFormat>(absl::StrSplit(examples, '\n'));
}

}  // namespace touchstone::cli
