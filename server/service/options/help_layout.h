// How --help of every program is laid out: lines of the terminal's width, texts of options beside their names or, where there is
// no room, under them.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace touchstone::service {

// An example and the remark behind it (after three blanks), indented, as lines of at most `width` columns: the command goes on
// after a backslash, so that it can be copied, and the remark stands under it.
std::string FittedExample(const std::string& line, size_t width);

class HelpLayout : public CLI::Formatter {
 public:
  HelpLayout();
  std::string make_description(const CLI::App* app) const override;
  std::string make_usage(const CLI::App* app, std::string name) const override;
  std::string make_footer(const CLI::App* app) const override;
  // One blank line between paragraphs.
  std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override;
  std::string make_subcommand(const CLI::App* sub) const override;
  std::string make_option(const CLI::Option* option, bool is_positional) const override;
  std::string make_option_opts(const CLI::Option* option) const override;

 protected:
  static constexpr size_t kBelowColumn = 6;  // on a narrow terminal, and of what follows a broken line
};

}  // namespace touchstone::service
