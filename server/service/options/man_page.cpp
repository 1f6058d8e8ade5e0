#include "server/service/options/man_page.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_replace.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "server/base/process/version.h"

namespace touchstone::service {
namespace {

// As roff takes it: hyphens that can be searched and pasted, no line that begins like a request.
std::string Roff(absl::string_view text) {
  const std::string escaped =
      absl::StrReplaceAll(text, {{"\\", "\\e"}, {"-", "\\-"}, {"\n.", "\n\\&."}, {"\n'", "\n\\&'"}});
  return absl::StartsWith(escaped, ".") || absl::StartsWith(escaped, "'") ? "\\&" + escaped : escaped;
}

// Examples as lines of their own, the rest in paragraphs.
struct HelpText {
  std::vector<std::string> paragraphs;
  std::string examples;
};

HelpText PartsOf(const std::string& help) {
  HelpText parts;
  for (absl::string_view paragraph : absl::StrSplit(help, "\n\n")) {
    paragraph = absl::StripAsciiWhitespace(paragraph);
    if (absl::ConsumePrefix(&paragraph, "Examples:\n")) {
      for (const absl::string_view line : absl::StrSplit(paragraph, '\n'))
        absl::StrAppend(&parts.examples, absl::StripAsciiWhitespace(line), "\n");
    } else if (!paragraph.empty()) {
      parts.paragraphs.push_back(absl::StrJoin(absl::StrSplit(paragraph, '\n'), " "));
    }
  }
  return parts;
}

// "Prints the state", of "Prints the state. Needs no lease."
std::string FirstSentence(const std::string& text) {
  return std::string(absl::StripSuffix(text.substr(0, text.find(". ")), "."));
}

std::string NamesOf(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  std::string text = names.empty() ? option.get_name() : absl::StrJoin(names, ", ");
  if (!names.empty() && !option.get_type_name().empty()) absl::StrAppend(&text, " ", option.get_type_name());
  return text;
}

void AppendOption(const CLI::Option& option, std::string* page) {
  absl::StrAppend(page, ".TP\n.B ", Roff(NamesOf(option)), "\n", Roff(option.get_description()));
  if (option.get_required()) absl::StrAppend(page, " (required)");
  if (!option.get_default_str().empty()) absl::StrAppend(page, " [", Roff(option.get_default_str()), "]");
  absl::StrAppend(page, "\n");
}

void AppendOptions(const CLI::App& app, std::string* page) {
  std::vector<std::string> groups;
  for (const CLI::Option* option : app.get_options())
    if (!option->get_group().empty() &&
        std::find(groups.begin(), groups.end(), option->get_group()) == groups.end())
      groups.push_back(option->get_group());
  std::string positionals;
  for (const CLI::Option* option : app.get_options())
    if (option->get_positional() && option->get_lnames().empty()) AppendOption(*option, &positionals);
  if (!positionals.empty()) absl::StrAppend(page, ".SH ARGUMENTS\n", positionals);
  bool first = true;
  for (const std::string& group : groups) {
    std::string rows;
    for (const CLI::Option* option : app.get_options())
      if (option->get_group() == group && !(option->get_positional() && option->get_lnames().empty()))
        AppendOption(*option, &rows);
    if (rows.empty()) continue;
    absl::StrAppend(page, first ? ".SH OPTIONS\n" : "",
                    groups.size() > 1 ? absl::StrCat(".SS ", Roff(group), "\n") : "", rows);
    first = false;
  }
}

}  // namespace

std::string ManPage(const CLI::App& app, const std::vector<std::string>& words,
                    const std::vector<std::string>& see_also) {
  // Ours has the examples there.
  const auto* const format = dynamic_cast<const CLI::Formatter*>(app.get_formatter().get());
  const HelpText text = PartsOf(format == nullptr ? app.get_description() : format->make_description(&app));
  const std::string name = absl::StrJoin(words, "-"), called = absl::StrJoin(words, " ");
  std::vector<const CLI::App*> commands;
  for (const CLI::App* command : app.get_subcommands({}))
    if (!command->get_group().empty()) commands.push_back(command);
  std::string page =
      absl::StrCat(".TH ", Roff(absl::AsciiStrToUpper(name)), " 1 \"\" \"Touchstone ", kVersion,
                   "\" \"Touchstone\"\n.nh\n.ad l\n.SH NAME\n", Roff(name), " \\- ",
                   Roff(text.paragraphs.empty() ? called : FirstSentence(text.paragraphs[0])), "\n");
  absl::StrAppend(&page, ".SH SYNOPSIS\n.B ", Roff(called), "\n");
  for (const CLI::Option* option : app.get_options())
    if (option->get_positional() && option->get_lnames().empty())
      absl::StrAppend(&page,
                      option->get_required() ? Roff(option->get_name())
                                             : absl::StrCat("[", Roff(option->get_name()), "]"),
                      "\n");
  absl::StrAppend(&page, commands.empty() ? "[OPTION ...]\n" : "COMMAND [OPTION ...]\n", ".SH DESCRIPTION\n");
  for (size_t k = 0; k < text.paragraphs.size(); ++k)
    absl::StrAppend(&page, k == 0 ? "" : ".PP\n", Roff(text.paragraphs[k]), "\n");
  if (!commands.empty()) absl::StrAppend(&page, ".SH COMMANDS\n");
  for (const CLI::App* command : commands)
    absl::StrAppend(&page, ".TP\n.BR ", Roff(absl::StrCat(name, "-", command->get_name())), " (1)\n",
                    Roff(FirstSentence(command->get_description())), "\n");
  AppendOptions(app, &page);
  if (!text.examples.empty()) absl::StrAppend(&page, ".SH EXAMPLES\n.nf\n", Roff(text.examples), ".fi\n");
  if (!app.get_footer().empty()) absl::StrAppend(&page, ".SH NOTES\n", Roff(app.get_footer()), "\n");
  if (!see_also.empty()) {
    absl::StrAppend(&page, ".SH SEE ALSO\n");
    for (size_t k = 0; k < see_also.size(); ++k)
      absl::StrAppend(&page, ".BR ", Roff(see_also[k]), " (1)", k + 1 < see_also.size() ? ",\n" : "\n");
  }
  return page;
}

bool PrintedManPage(const CLI::App& app, int argc, const char* const* argv) {
  if (argc != 2 || std::string(argv[1]) != "--man") return false;
  std::vector<std::string> others;
  for (const char* program : {"touchstone", "touchstone-server", "touchstone-gateway", "touchstone-probe",
                              "touchstone-rig-emulator"})
    if (app.get_name() != program) others.push_back(program);
  std::fputs(ManPage(app, {app.get_name()}, others).c_str(), stdout);
  return true;
}

}  // namespace touchstone::service
