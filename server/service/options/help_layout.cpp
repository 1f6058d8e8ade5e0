#include "server/service/options/help_layout.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <algorithm>
#include <vector>

#include "server/base/text/wrapped_text.h"

namespace touchstone::service {
namespace {

constexpr size_t kHelpColumn = 32, kNarrowHelpColumn = 26;  // where the texts of options begin
constexpr size_t kNarrow = 100, kVeryNarrow = 70;
constexpr size_t kBroken = 6;  // where what follows a broken example begins

// Lines of a text stay lines; those that are indented are examples.
std::string WrapLines(const std::string& text) {
  std::string wrapped;
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    if (absl::StartsWith(line, "  "))
      wrapped += FittedExample(std::string(absl::StripLeadingAsciiWhitespace(line)), TextWidth());
    else
      absl::StrAppend(&wrapped, Wrap(line, TextWidth(), 0), "\n");
  }
  wrapped.pop_back();
  return wrapped;
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

}  // namespace

std::string FittedExample(const std::string& line, size_t width) {
  if (line.size() + 2 <= width) return "  " + line + "\n";
  const size_t gap = line.find("   ");
  std::string text = " ";
  size_t column = 1;
  for (const std::string& word : UnbrokenWords(absl::string_view(line).substr(0, gap))) {
    if (column > kBroken && column + 1 + word.size() + 2 > width) {  // room for the backslash
      absl::StrAppend(&text, " \\\n", std::string(kBroken - 1, ' '));
      column = kBroken - 1;
    }
    absl::StrAppend(&text, " ", word);
    column += 1 + word.size();
  }
  if (gap != std::string::npos)
    absl::StrAppend(&text, "\n", std::string(kBroken, ' '), "# ",
                    absl::StripLeadingAsciiWhitespace(absl::string_view(line).substr(gap)));
  return text + "\n";
}

HelpLayout::HelpLayout() {
  label("OPTIONS", "OPTIONS");
  label("Positionals", "Arguments");
  label("Subcommands", "Commands");
  label("REQUIRED", "(required)");
  label("TEXT", "TEXT");
}

std::string HelpLayout::make_description(const CLI::App* app) const {
  return WrapLines(app->get_description()) + "\n\n";
}

std::string HelpLayout::make_usage(const CLI::App* app, std::string name) const {
  std::string usage = CLI::Formatter::make_usage(app, std::move(name));
  absl::StripAsciiWhitespace(&usage);
  return Wrap(usage, TextWidth(), kBelowColumn) + "\n";
}

std::string HelpLayout::make_footer(const CLI::App* app) const {
  const std::string footer = app->get_footer();
  return footer.empty() ? "" : Wrap(footer, TextWidth(), 0) + "\n";
}

std::string HelpLayout::make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const {
  std::string help = CLI::Formatter::make_help(app, name, mode);
  for (size_t at; (at = help.find("\n\n\n")) != std::string::npos;) help.erase(at, 1);
  while (help.size() > 1 && help.compare(help.size() - 2, 2, "\n\n") == 0) help.pop_back();
  return help;
}

std::string HelpLayout::make_subcommand(const CLI::App* sub) const {
  const std::string name = "  " + sub->get_name() + "  ";
  return name + Wrap(sub->get_description(), TextWidth(), name.size()) + "\n";
}

std::string HelpLayout::make_option(const CLI::Option* option, bool is_positional) const {
  const size_t width = TextWidth();
  std::string left =
      "  " + Wrap(make_option_name(option, is_positional) + make_option_opts(option), width, kBelowColumn);
  const size_t column = width < kVeryNarrow ? kBelowColumn
                        : width < kNarrow   ? kNarrowHelpColumn
                                            : kHelpColumn;
  if (left.size() + 2 > column)
    left += "\n" + std::string(column, ' ');
  else
    left.append(column - left.size(), ' ');
  return left + Wrap(make_option_desc(option), width, column) + "\n";
}

std::string HelpLayout::make_option_opts(const CLI::Option* option) const {
  std::string text;
  if (option->get_type_size() != 0 && !option->get_type_name().empty()) text += " " + option->get_type_name();
  if (!option->get_default_str().empty()) absl::StrAppend(&text, " [", option->get_default_str(), "]");
  if (option->get_required()) text += " (required)";
  return text;
}

}  // namespace touchstone::service
