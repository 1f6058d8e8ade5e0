// Parsing: the help with examples first, and usage errors that say what was probably meant.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_replace.h>
#include <absl/strings/str_split.h>
#include <absl/strings/strip.h>

#include "client/cli/common/common.h"
#include "client/cli/common/help_format.h"
#include "client/cli/common/interrupt.h"
#include "client/cli/common/progress_bar.h"
#include "client/cli/common/provenance.h"
#include "client/cli/common/terminal.h"
#include "client/source/connection/lease_keeper.h"
#include "server/base/process/version.h"
#include "server/base/status.h"
#include "server/base/text/printable.h"
#include "server/base/text/text.h"
#include "server/base/text/whole_number.h"
#include "server/geometry/files/mesh_file.h"

namespace touchstone::cli {
namespace {

// Types of the options that are counts and seeds.
bool IsWholeNumber(const CLI::Option* option) {
  return option->get_type_name() == "N" || option->get_type_name() == "1-100";
}

std::vector<std::string> OptionNames(const CLI::App* app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app->get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  return names;
}

std::vector<std::string> CommandNames(const CLI::App* app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app->get_subcommands({})) names.push_back(command->get_name());
  return names;
}

// Of an option that is a count or a seed.
std::string CheckWholeNumber(std::string& text) {
  const absl::StatusOr<uint64_t> value = ParseWholeNumber(text);
  if (!value.ok()) return std::string(value.status().message());
  text = absl::StrCat(*value);
  return "";
}

// What a server, a file or a person wrote, as it may stand on a terminal.
std::string Shown(absl::string_view text) {
  return Printable(text, std::string::npos, /*keep_lines=*/true);
}

// The same with the styles that reports have on a terminal (client/report/words/text_layout.cpp).
std::string ShownWithStyles(absl::string_view text) {
  std::string shown = Shown(text);
  for (const char* style : {"[0m", "[1m", "[2m", "[32m", "[33m", "[36m"})
    absl::StrReplaceAll({{absl::StrCat("\\x1b", style), absl::StrCat("\x1b", style)}}, &shown);
  return shown;
}

int PrintError(absl::string_view message) {
  ProgressBar::ClearShown();
  std::fflush(stdout);
  std::fprintf(stderr, "touchstone: error: %s\n", Shown(message).c_str());
  return kBadInput;
}

}  // namespace

Cli::Cli()
    : app_(
          "Touches and photographs objects, simulated or on a rig, says what a simulation lacks, and streams "
          "datasets",
          "touchstone") {
  app_.formatter(
      ExamplesFirst("touchstone objects                                      what can be touched\n"
                    "touchstone touch lat20 --approach 0,0,-1                one touch from above\n"
                    "touchstone capture lat20 --approach 0,0,-1 -o top.png   its photograph\n"
                    "touchstone stream --samples 10000 --out data            a dataset of touches\n"
                    "touchstone diagnose set.csv --model nominal.yaml        where and why a model is wrong\n"
                    "touchstone doctor                                       is everything in order here?"));
  app_.set_help_flag("-h,--help", "This text; also touchstone COMMAND --help");
  app_.set_version_flag("--version", absl::StrCat("touchstone ", kVersion), "The version");
  app_.require_subcommand(0, 1);
  app_.footer(
      "Without --server the simulation runs in this process; with --server HOST:PORT, or "
      "TOUCHSTONE_SERVER=HOST:PORT in the environment, a running touchstone-server does it. Both give the "
      "same bytes. Exit codes: 0 done, 2 usage or bad input, 3 source unreachable, "
      "4 refused or failed by the source, 130 interrupted.");
}

CLI::App* Cli::AddCommand(CLI::App* parent, const std::string& name, const std::string& description,
                          const std::string& examples, std::function<absl::Status()> run) {
  CLI::App* command = (parent == nullptr ? &app_ : parent)->add_subcommand(name, description);
  command->group("Commands");
  command->formatter(ExamplesFirst(examples));
  command->footer("");
  runs_[command] = std::move(run);
  return command;
}

CLI::App* Cli::AddForwarded(const std::string& name, const std::string& description,
                            std::vector<std::string> options,
                            std::function<absl::Status(const std::vector<std::string>&)> run) {
  CLI::App* command = app_.add_subcommand(name, description);
  command->group("Commands");
  command->set_help_flag();
  command->prefix_command();
  forwarded_[command] = {std::move(options), std::move(run)};
  return command;
}

bool Cli::Forward(const CLI::App* command, const std::vector<std::string>& arguments,
                  absl::Status* status) const {
  const auto forwarded = forwarded_.find(command);
  if (forwarded == forwarded_.end()) return false;
  *status = forwarded->second.run(arguments);
  return true;
}

std::vector<std::string> Cli::OptionsOf(const CLI::App* command) const {
  const auto forwarded = forwarded_.find(command);
  if (forwarded != forwarded_.end()) return forwarded->second.options;
  std::vector<std::string> options;
  for (const CLI::Option* option : command->get_options()) {
    for (const std::string& name : option->get_lnames()) options.push_back("--" + name);
    for (const std::string& name : option->get_snames()) options.push_back("-" + name);
  }
  return options;
}

CLI::App* Cli::AddGroup(const std::string& name, const std::string& description,
                        const std::string& examples) {
  CLI::App* group = app_.add_subcommand(name, description);
  group->group("Commands");
  group->formatter(ExamplesFirst(examples));
  group->set_help_flag("-h,--help", "This text");
  group->footer("");
  group->require_subcommand(0, 1);
  return group;
}

CLI::Option* Cli::AddOutputOf(CLI::App* command, const std::string& name, std::string* path,
                              const std::string& text, OutputKind kind, bool json_is_a_format) {
  CLI::Option* option = command->add_option(name, *path, text);
  option->type_name(kind == OutputKind::kFolder ? "FOLDER" : "FILE");
  files_[command].outputs.push_back({option, kind, json_is_a_format});
  const bool replaces = kind == OutputKind::kFile || kind == OutputKind::kPrefix;
  if (replaces && command->get_option_no_throw("--force") == nullptr)
    command->add_flag("--force", output_.force, "Replace output files that exist")->group("Output");
  return option;
}

CLI::Option* Cli::AddOutput(CLI::App* command, const std::string& name, std::string* path,
                            const std::string& text, OutputKind kind) {
  return AddOutputOf(command, name, path, text, kind, /*json_is_a_format=*/false);
}

CLI::Option* Cli::AddFormattedOutput(CLI::App* command, const std::string& name, std::string* path,
                                     const std::string& text) {
  return AddOutputOf(command, name, path, text, OutputKind::kFile, /*json_is_a_format=*/true);
}

void Cli::AddInput(CLI::App* command, const CLI::Option* option) {
  files_[command].inputs.push_back(option);
}

absl::Status Cli::CheckFiles(const CLI::App* command) {
  const CommandFiles& files = files_[command];
  std::vector<std::string> inputs = source_.meshes;
  for (std::string& mesh : inputs) {
    const absl::StatusOr<source::MeshSpec> source = service::ParseMeshSpec(mesh);
    mesh = source.ok() ? source->path : "";  // what is wrong with it is said where it is read
  }
  for (const CLI::Option* option : files.inputs)
    for (const std::string& path : option->results()) inputs.push_back(path);
  std::error_code error;
  if (!source_.mesh_folder.empty()) {
    const std::vector<std::string> formats = geometry::MeshFormatNames();
    std::filesystem::directory_iterator entries(source_.mesh_folder, error);
    if (error)
      return absl::NotFoundError(absl::StrCat("--mesh-dir: '", source_.mesh_folder, "': ", error.message(),
                                              "; a folder of mesh files was expected"));
    for (const auto& entry : entries) {
      const std::string extension = absl::AsciiStrToLower(entry.path().extension().string());
      for (const std::string& format : formats)
        if (extension == "." + format) inputs.push_back(entry.path().string());
    }
  }
  // A journal has two files beside it while it is open.
  for (size_t i = inputs.size(); i-- > 0;)
    if (absl::EndsWith(inputs[i], ".db"))
      for (const char* beside : {"-wal", "-shm"}) inputs.push_back(inputs[i] + beside);
  inputs_ = std::move(inputs);

  std::vector<OutputFile> outputs;
  for (const auto& [option, kind, json_is_a_format] : files.outputs) {
    if (option->count() == 0) continue;
    const std::string path = option->results().back();
    const std::string name =
        option->get_snames().empty() ? option->get_name() : "-" + option->get_snames()[0];
    if (kind != OutputKind::kPrefix) outputs.push_back({name, path, kind});
    if (!IsStandardOutput(path)) continue;
    stdout_taken_ = true;
    if (output_.json && !json_is_a_format)
      return absl::InvalidArgumentError(absl::StrCat(name, " and --json: both are standard output"));
  }
  return CheckOutputs(outputs);
}

absl::Status Cli::CheckOutputs(const std::vector<OutputFile>& outputs) const {
  return CheckOutputFiles(outputs, inputs_, output_.force);
}

absl::Status Cli::Write(const std::string& path, absl::string_view data) const {
  return WriteOutputFile(path, data, output_.force);
}

absl::Status Cli::Print(absl::string_view text) const {
  const std::string shown = ColourOnStdout() ? ShownWithStyles(text) : Shown(text);
  ProgressBar::ClearShown();
  std::fwrite(shown.data(), 1, shown.size(), stdout_taken_ ? stderr : stdout);
  return absl::OkStatus();
}

void Cli::LogWritten(const std::string& path, absl::string_view details) const {
  if (!path.empty() && !IsStandardOutput(path)) Log(absl::StrCat("wrote ", path, details));
}

void Cli::AddOutputOptions(CLI::App* command) {
  // A command whose --json names a file has its own.
  if (command->get_option_no_throw("--json") == nullptr)
    command
        ->add_flag("--json", output_.json, "Machine-readable output; the names of numbers end in their unit")
        ->group("Output");
  command->add_flag("-q,--quiet", output_.quiet, "Nothing but errors on stderr")->group("Output");
  command->add_flag("-v,--verbose", output_.verbose, "More about what happens on stderr")->group("Output");
  command->set_help_flag("-h,--help", "This text")->group("Output");
}

void Cli::Log(absl::string_view line) const {
  if (!output_.quiet) Warn(line);
}

void Cli::Warn(absl::string_view line) const {
  ProgressBar::ClearShown();
  std::fprintf(stderr, "%s\n", Shown(line).c_str());
}

void Cli::Detail(absl::string_view line) const {
  if (output_.verbose) Log(line);
}

std::string Cli::HelpCommand() const {
  std::string text = "touchstone";
  const CLI::App* app = &app_;
  while (!app->get_subcommands().empty()) {
    app = app->get_subcommands()[0];
    text += " " + app->get_name();
  }
  return text;
}

int Cli::UsageError(const CLI::ParseError& error, int argc, char** argv) {
  // The deepest command that was understood.
  const CLI::App* app = &app_;
  while (!app->get_subcommands().empty()) app = app->get_subcommands()[0];
  const std::string help = absl::StrCat(" (see ", HelpCommand(), " --help)");

  for (const std::string& word : app_.remaining(true)) {
    if (word.size() > 1 && word[0] == '-') {
      const std::string name = word.substr(0, word.find('='));
      return PrintError(
          absl::StrCat("unknown option '", name, "'", DidYouMean(name, OptionNames(app)), help));
    }
    const std::vector<std::string> commands = CommandNames(app);
    if (!commands.empty())
      return PrintError(absl::StrCat("unknown command '", word, "'", DidYouMean(word, commands), help));
    return PrintError(absl::StrCat("'", word, "' is one argument too many", help));
  }
  // "Could not convert: --speed-mm-s = 20mm"
  absl::string_view what = error.what();
  if (absl::ConsumePrefix(&what, "Could not convert: ")) {
    const std::pair<absl::string_view, absl::string_view> option =
        absl::StrSplit(what, absl::MaxSplits(" = ", 1));
    const CLI::Option* named = app->get_option_no_throw(std::string(option.first));
    if (named != nullptr && IsWholeNumber(named))
      return PrintError(absl::StrCat(option.first, ": '", option.second, "' is too large", help));
    return PrintError(absl::StrCat(option.first, ": '", option.second,
                                   "' is not a number; one like 12.5 was expected, without a unit", help));
  }
  return PrintError(absl::StrCat(what, help));
}

int Cli::Run(int argc, char** argv) {
  command_line_ = ShellCommand(argc, argv);
  arguments_.assign(argv + std::min(argc, 1), argv + argc);
  // Last in every help, since they are the same everywhere.
  for (const auto& [command, run] : runs_) AddOutputOptions(const_cast<CLI::App*>(command));
  for (const auto& [command, run] : runs_)
    for (CLI::Option* option : const_cast<CLI::App*>(command)->get_options())
      if (IsWholeNumber(option)) option->transform(CLI::Validator(CheckWholeNumber, ""));
  try {
    app_.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    std::printf("%s", app_.help().c_str());
    return kDone;
  } catch (const CLI::CallForVersion&) {
    std::printf("touchstone %s\n", kVersion);
    return kDone;
  } catch (const CLI::ParseError& error) {
    return UsageError(error, argc, argv);
  }
  const CLI::App* app = &app_;
  while (!app->get_subcommands().empty()) app = app->get_subcommands()[0];
  const auto run = runs_.find(app);
  const auto name = std::find(arguments_.begin(), arguments_.end(), app->get_name());
  absl::Status status;
  if (name != arguments_.end() && Forward(app, {name + 1, arguments_.end()}, &status)) {
    PrintError(status.message());
    return ExitCodeOf(status);
  }
  if (run == runs_.end()) {
    // "touchstone" or "touchstone model" alone: what there is, but not as a success.
    std::fprintf(stderr, "%s", app_.help().c_str());
    return kBadInput;
  }
  // "rig-run": who holds a lease or stops a source is told with it.
  client::SetHolderProgram(
      absl::StrReplaceAll(HelpCommand().substr(std::strlen("touchstone ")), {{" ", "-"}}));
  status = ChooseServers(app);
  if (status.ok()) status = CheckFiles(app);
  if (status.ok()) {
    // Of commands that show nothing better.
    ProgressBar working(!output_.quiet);
    working.ShowStage(HelpCommand());
    status = run->second();
  }
  if (std::fflush(stdout) != 0 || std::ferror(stdout)) {
    if (status.ok()) status = absl::ResourceExhaustedError("stdout: the output could not be written whole");
  }
  if (Interrupt::Raised()) {
    if (!status.ok() && !absl::IsCancelled(status)) PrintError(status.message());
    return kInterrupted;
  }
  if (status.ok()) return kDone;
  PrintError(status.message());
  return ExitCodeOf(status);
}

}  // namespace touchstone::cli
