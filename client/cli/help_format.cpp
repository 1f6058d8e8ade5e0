#include "client/cli/help_format.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_split.h>

#include "client/cli/common.h"
#include "client/cli/terminal.h"

namespace touchstone::cli {
namespace {

constexpr size_t kHelpColumn = 32, kNarrowHelpColumn = 26;  // where the texts of options begin
constexpr size_t kBelowColumn = 6;  // on a narrow terminal, and of what follows a broken example
constexpr size_t kNarrow = 100, kVeryNarrow = 70;

// Texts of options stand under their names where a terminal has no room beside them.
size_t HelpColumn() {
  const size_t width = TextWidth();
  return width < kVeryNarrow ? kBelowColumn : width < kNarrow ? kNarrowHelpColumn : kHelpColumn;
}

// An example and the remark behind it on a terminal that is too narrow for them: the command goes on after a backslash, so that
// it can be copied, and the remark stands under it.
std::string FittedExample(const std::string& line, size_t width) {
  if (line.size() + 2 <= width) return "  " + line + "\n";
  const size_t gap = line.find("   ");
  const std::string remark(gap == std::string::npos
                               ? absl::string_view()
                               : absl::StripLeadingAsciiWhitespace(absl::string_view(line).substr(gap)));
  std::string text;
  const std::string command = Wrap(absl::string_view(line).substr(0, gap), width - 4, kBelowColumn - 2);
  for (const absl::string_view part : absl::StrSplit(command, '\n'))
    absl::StrAppend(&text, text.empty() ? "  " : " \\\n  ", part);
  if (!remark.empty()) absl::StrAppend(&text, "\n", std::string(kBelowColumn, ' '), "# ", remark);
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
    text.append(text.size() < 14 ? 14 - text.size() : 1, ' ');
    return text + Wrap(line, TextWidth(), text.size()) + "\n";
  }

  std::string make_option(const CLI::Option* option, bool is_positional) const override {
    std::string left = "  " + make_option_name(option, is_positional) + make_option_opts(option);
    const size_t column = HelpColumn();
    if (left.size() + 2 > column)
      left += "\n" + std::string(column, ' ');
    else
      left.append(column - left.size(), ' ');
    return left + Wrap(make_option_desc(option), TextWidth(), column) + "\n";
  }

  std::string make_option_opts(const CLI::Option* option) const override {
    std::string text;
    if (option->get_type_size() != 0) text += " " + option->get_type_name();
    if (option->get_required()) text += " (required)";
    return text;
  }

 private:
  // One per line; as they are where nobody sees them on a terminal.
  std::string Examples() const {
    std::string text;
    for (const std::string& line : examples_)
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
