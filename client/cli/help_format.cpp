#include "client/cli/help_format.h"

#include "client/cli/common.h"
#include "client/cli/terminal.h"

namespace touchstone::cli {
namespace {

constexpr size_t kHelpColumn = 32;

// One line of what it is, then examples, then usage and options.
class HelpFormat : public CLI::Formatter {
 public:
  explicit HelpFormat(std::string examples) : examples_(std::move(examples)) {
    column_width(kHelpColumn);
    label("OPTIONS", "OPTIONS");
    label("Positionals", "Arguments");
    label("Subcommands", "Commands");
    label("REQUIRED", "(required)");
    label("TEXT", "TEXT");
  }

  std::string make_description(const CLI::App* app) const override {
    return absl::StrCat(Wrap(app->get_description(), TextWidth(), 0), "\n\nExamples:\n", examples_, "\n");
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
    if (left.size() + 2 > kHelpColumn)
      left += "\n" + std::string(kHelpColumn, ' ');
    else
      left.append(kHelpColumn - left.size(), ' ');
    return left + Wrap(make_option_desc(option), TextWidth(), kHelpColumn) + "\n";
  }

  std::string make_option_opts(const CLI::Option* option) const override {
    std::string text;
    if (option->get_type_size() != 0) text += " " + option->get_type_name();
    if (option->get_required()) text += " (required)";
    return text;
  }

 private:
  std::string examples_;
};

// "  touchstone objects" for each line of examples.
std::string Indented(const std::string& lines) {
  std::string text = "  ";
  for (const char c : lines) {
    text += c;
    if (c == '\n') text += "  ";
  }
  return text + "\n";
}

}  // namespace

std::shared_ptr<CLI::FormatterBase> ExamplesFirst(const std::string& examples) {
  return std::make_shared<HelpFormat>(Indented(examples));
}

}  // namespace touchstone::cli
