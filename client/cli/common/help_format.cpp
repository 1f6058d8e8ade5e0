#include "client/cli/common/help_format.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_split.h>

#include <algorithm>

#include "client/cli/common/common.h"
#include "client/cli/common/terminal.h"

namespace touchstone::cli {
namespace {

constexpr size_t kHelpColumn = 32, kNarrowHelpColumn = 26;  // where the texts of options begin
constexpr size_t kCommandColumn = 15;  // where the texts of commands begin: two after the longest name
constexpr size_t kBelowColumn = 6;     // on a narrow terminal, and of what follows a broken example
constexpr size_t kNarrow = 100, kVeryNarrow = 70;

// Texts of options stand under their names where a terminal has no room beside them.
size_t HelpColumn() {
  const size_t width = TextWidth();
  return width < kVeryNarrow ? kBelowColumn : width < kNarrow ? kNarrowHelpColumn : kHelpColumn;
}

// The words of a command, each option with the value behind it; what is in quotes is whole.
std::vector<std::string> UnbrokenWords(absl::string_view command) {
  std::vector<std::string> words;
  bool quoted = false, option = false;
  for (const absl::string_view word : absl::StrSplit(command, ' ', absl::SkipEmpty())) {
    const bool joins = quoted || (option && word[0] != '-');
    if (joins)
      absl::StrAppend(&words.back(), " ", word);
    else
      words.emplace_back(word);
    option = !joins && word[0] == '-' && !absl::StrContains(word, "=");
    if (std::count(word.begin(), word.end(), '\'') % 2 == 1) quoted = !quoted;
  }
  return words;
}

// An example and the remark behind it on a terminal that is too narrow for them: the command goes on after a backslash, so that
// it can be copied, and the remark stands under it.
std::string FittedExample(const std::string& line, size_t width) {
  if (line.size() + 2 <= width) return "  " + line + "\n";
  const size_t gap = line.find("   ");
  std::string text = " ";
  size_t column = 1;
  for (const std::string& word : UnbrokenWords(absl::string_view(line).substr(0, gap))) {
    if (column > kBelowColumn && column + 1 + word.size() + 2 > width) {  // room for the backslash
      absl::StrAppend(&text, " \\\n", std::string(kBelowColumn - 1, ' '));
      column = kBelowColumn - 1;
    }
    absl::StrAppend(&text, " ", word);
    column += 1 + word.size();
  }
  if (gap != std::string::npos)
    absl::StrAppend(&text, "\n", std::string(kBelowColumn, ' '), "# ",
                    absl::StripLeadingAsciiWhitespace(absl::string_view(line).substr(gap)));
  return text + "\n";
}

// One line of what it is, then examples, then usage and options.
class HelpFormat : public CLI::Formatter {
 public:
  explicit HelpFormat(std::vector<std::string> examples) : examples_(std::move(examples)) {
    label("OPTIONS", "OPTIONS");
    label("Positionals", "Arguments");
    label("Subcommands", "Commands");
    label("REQUIRED", "(required)");
    label("TEXT", "TEXT");
  }

  std::string make_description(const CLI::App* app) const override {
    return absl::StrCat(Wrap(app->get_description(), TextWidth(), 0), "\n\nExamples:\n", Examples(), "\n");
  }

  std::string make_usage(const CLI::App* app, std::string name) const override {
    std::string usage = CLI::Formatter::make_usage(app, std::move(name));
    absl::StripAsciiWhitespace(&usage);
    return Wrap(usage, TextWidth(), kBelowColumn) + "\n";
  }

  std::string make_footer(const CLI::App* app) const override {
    const std::string footer = app->get_footer();
    return footer.empty() ? "" : Wrap(footer, TextWidth(), 0) + "\n";
  }

  // One blank line between paragraphs.
  std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override {
    std::string help = CLI::Formatter::make_help(app, name, mode);
    for (size_t at; (at = help.find("\n\n\n")) != std::string::npos;) help.erase(at, 1);
    while (help.size() > 1 && help.compare(help.size() - 2, 2, "\n\n") == 0) help.pop_back();
    return help;
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

  std::string make_option(const CLI::Option* option, bool is_positional) const override {
    std::string left = "  " + make_option_name(option, is_positional) + make_option_opts(option);
    left.erase(left.find_last_not_of(' ') + 1);
    const size_t column = HelpColumn();
    if (left.size() + 2 > column)
      left += "\n" + std::string(column, ' ');
    else
      left.append(column - left.size(), ' ');
    return left + Wrap(make_option_desc(option), TextWidth(), column) + "\n";
  }

  std::string make_option_opts(const CLI::Option* option) const override {
    std::string text;
    if (option->get_type_size() != 0 && !option->get_type_name().empty())
      text += " " + option->get_type_name();
    if (option->get_required()) text += " (required)";
    return text;
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
      absl::StrAppend(&text, OnTerminal() ? FittedExample(line, static_cast<size_t>(TerminalWidth()))
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
