#include "server/service/option_table.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <CLI/CLI.hpp>

// toml++ 3.3 takes for granted that a table's name follows its bracket. A file in which a line ends there would abort a
// build with assertions, and be undefined in one without; with neither, the parser's next check answers with an error.
#pragma push_macro("NDEBUG")
#undef NDEBUG
#define TOML_ASSERT(expression) static_cast<void>(0)
#include <toml++/toml.h>
#pragma pop_macro("NDEBUG")
#include <cassert>

#include <algorithm>
#include <cstdint>
#include <cstdio>

#include "server/base/status.h"
#include "server/base/text.h"
#include "server/service/resources.h"

namespace touchstone::service {
namespace {

template <typename Value, typename Read>
absl::Status AssignList(const toml::node& node, const std::string& where, const char* expected,
                        std::vector<Value>* list, Read read) {
  const toml::array* array = node.as_array();
  if (array == nullptr) return absl::InvalidArgumentError(absl::StrCat(where, ": must be ", expected));
  list->clear();
  for (const toml::node& entry : *array) {
    if (!read(entry, list)) return absl::InvalidArgumentError(absl::StrCat(where, ": must be ", expected));
  }
  return absl::OkStatus();
}

absl::Status Assign(const toml::node& node, const std::string& where, const Option::Target& target) {
  const auto wrong = [&](const char* expected) {
    return absl::InvalidArgumentError(absl::StrCat(where, ": must be ", expected));
  };
  if (auto* text = std::get_if<std::string*>(&target)) {
    if (!node.is_string()) return wrong("a text in quotes");
    **text = *node.value<std::string>();
  } else if (auto* whole = std::get_if<int*>(&target)) {
    const auto value = node.value_exact<int64_t>();
    if (!value || *value < INT32_MIN || *value > INT32_MAX) return wrong("a whole number");
    **whole = static_cast<int>(*value);
  } else if (auto* real = std::get_if<double*>(&target)) {
    if (!node.is_number()) return wrong("a number");
    **real = *node.value<double>();
  } else if (auto* yes = std::get_if<bool*>(&target)) {
    if (!node.is_boolean()) return wrong("true or false");
    **yes = *node.value<bool>();
  } else if (auto* numbers = std::get_if<std::vector<double>*>(&target)) {
    return AssignList(node, where, "a list of numbers", *numbers, [](const toml::node& entry, auto* list) {
      if (entry.is_number()) list->push_back(*entry.value<double>());
      return entry.is_number();
    });
  } else {
    std::vector<std::string>& list = *std::get<std::vector<std::string>*>(target);
    if (node.is_string()) {
      list = {*node.value<std::string>()};
      return absl::OkStatus();
    }
    return AssignList(node, where, "a text, or a list of texts", &list,
                      [](const toml::node& entry, auto* texts) {
                        if (entry.is_string()) texts->push_back(*entry.value<std::string>());
                        return entry.is_string();
                      });
  }
  return absl::OkStatus();
}

std::string FlagOfKey(const std::string& key) {
  return "--" + absl::StrReplaceAll(key, {{"_", "-"}, {".", "-"}});
}

// With that of its former key, as CLI11 takes several names of one flag.
std::string FlagNames(const Option& option) {
  return FlagOfKey(option.key) + (option.former_key.empty() ? "" : "," + FlagOfKey(option.former_key));
}

absl::Status ReadTable(const toml::table& table, const std::string& prefix, const std::string& origin,
                       const std::vector<Option>& options, const std::set<std::string>& set) {
  std::vector<std::string> known;
  for (const Option& option : options) known.push_back(option.key);
  for (const auto& [key, node] : table) {
    const std::string name = prefix + std::string(key.str());
    const std::string where = absl::StrCat(origin, ":", key.source().begin.line, ": ", name);
    const auto is_of = [&](const Option& o) { return o.key.rfind(name + ".", 0) == 0; };
    if (node.is_table() && std::any_of(options.begin(), options.end(), is_of)) {
      TOUCHSTONE_RETURN_IF_ERROR(ReadTable(*node.as_table(), name + ".", origin, options, set));
      continue;
    }
    const auto option = std::find_if(options.begin(), options.end(),
                                     [&](const Option& o) { return o.key == name || o.former_key == name; });
    if (option == options.end())
      return absl::InvalidArgumentError(absl::StrCat(where, ": unknown key", DidYouMean(name, known)));
    if (set.count(option->key)) continue;
    TOUCHSTONE_RETURN_IF_ERROR(Assign(node, where, option->target));
  }
  return absl::OkStatus();
}

}  // namespace

void AppendLimits(Limits* limits, std::vector<Option>* options) {
  for (const LimitRow& row : LimitTable()) {
    Option option;
    option.key = row.name;
    option.meaning = absl::StrCat("Limit: ", row.meaning, *row.unit == '\0' ? "" : ", ", row.unit);
    std::visit([&](auto member) { option.target = &(limits->*member); }, row.field);
    options->push_back(std::move(option));
  }
}

std::string FlagOf(const Option& option) {
  return FlagOfKey(option.key);
}

absl::Status ReadToml(const std::string& text, const std::string& origin, const std::vector<Option>& options,
                      const std::set<std::string>& set) {
  toml::table table;
  try {
    table = toml::parse(text, origin);
  } catch (const toml::parse_error& error) {
    return absl::InvalidArgumentError(absl::StrCat(origin, ":", error.source().begin.line, ":",
                                                   error.source().begin.column, ": ",
                                                   std::string(error.description())));
  }
  return ReadTable(table, "", origin, options, set);
}

void AddFlags(const std::vector<Option>& options, CLI::App* app) {
  for (const Option& option : options)
    std::visit(
        [&](auto* target) {
          using Value = std::remove_pointer_t<decltype(target)>;
          if constexpr (std::is_same_v<Value, bool>) {
            app->add_flag(FlagNames(option), *target, option.meaning);
          } else if constexpr (std::is_same_v<Value, std::vector<std::string>>) {
            app->add_option(FlagNames(option), *target, option.meaning)->allow_extra_args(false);
          } else if constexpr (std::is_same_v<Value, std::vector<double>>) {
            app->add_option(FlagNames(option), *target, option.meaning)->delimiter(',');
          } else {
            app->add_option(FlagNames(option), *target, option.meaning)->capture_default_str();
          }
        },
        option.target);
}

std::set<std::string> GivenKeys(const std::vector<Option>& options, const CLI::App& app) {
  std::set<std::string> given;
  for (const Option& option : options)
    if (app.count(FlagOf(option)) > 0) given.insert(option.key);
  return given;
}

absl::Status UnknownFlag(const std::vector<Option>& options, const CLI::App& app) {
  std::vector<std::string> known = {"--config", "--version", "--help"};
  for (const Option& option : options) known.push_back(FlagOf(option));
  const std::vector<std::string> extras = app.remaining();
  const std::string word = extras.empty() ? "" : extras[0].substr(0, extras[0].find('='));
  return absl::InvalidArgumentError(absl::StrCat("unknown flag ", word, DidYouMean(word, known)));
}

absl::StatusOr<CommandLine> ReadCommandLine(const std::string& program, const std::string& help,
                                            const std::string& config_help,
                                            const std::vector<Option>& options, int argc,
                                            const char* const* argv) {
  CommandLine line;
  CLI::App app(help, program);
  bool version = false;
  app.add_option("--config", line.config, config_help);
  app.add_flag("--version", version, "Print the version");
  AddFlags(options, &app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    std::fputs(app.help().c_str(), stdout);
    line.done = true;
    return line;
  } catch (const CLI::ExtrasError&) {
    return UnknownFlag(options, app);
  } catch (const CLI::ParseError& error) {
    return absl::InvalidArgumentError(error.what());
  }
  if (version) {
    std::printf("%s %s\n", program.c_str(), kVersion);
    line.done = true;
    return line;
  }
  line.given = GivenKeys(options, app);
  if (!line.config.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(line.config, 1 << 20));
    TOUCHSTONE_RETURN_IF_ERROR(ReadToml(text, line.config, options, line.given));
  }
  return line;
}

absl::Status CheckLogLevel(const std::string& level) {
  const std::vector<std::string> levels = {"trace", "debug", "info", "warn", "error", "off"};
  if (std::find(levels.begin(), levels.end(), level) != levels.end()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("log_level = '", level, "'", DidYouMean(level, levels)));
}

absl::Status CheckRange(double value, double lower, double upper, const std::string& name) {
  if (value >= lower && value <= upper) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(name, " = ", ShortestNumber(value), ": must be from ",
                                                 ShortestNumber(lower), " to ", ShortestNumber(upper)));
}

}  // namespace touchstone::service
