// Parsing: the help with examples first, and usage errors that say what was probably meant.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <set>

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>

#include "client/cli/common.h"
#include "client/cli/interrupt.h"
#include "server/base/status.h"
#include "server/base/text.h"
#include "server/base/version.h"
#include "server/geometry/mesh_file.h"

namespace touchstone::cli {
namespace {

constexpr size_t kHelpColumn = 32;
constexpr size_t kHelpWidth = 110;
constexpr double kMaxWaitS = 3600;

// One line of what it is, then examples, then usage and options.
class ExamplesFirst : public CLI::Formatter {
 public:
  explicit ExamplesFirst(std::string examples) : examples_(std::move(examples)) {
    column_width(kHelpColumn);
    label("OPTIONS", "OPTIONS");
    label("Positionals", "Arguments");
    label("Subcommands", "Commands");
    label("REQUIRED", "(required)");
    label("TEXT", "TEXT");
  }

  std::string make_description(const CLI::App* app) const override {
    return absl::StrCat(Wrap(app->get_description(), kHelpWidth, 0), "\n\nExamples:\n", examples_, "\n");
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
    return text + line + "\n";
  }

  std::string make_option(const CLI::Option* option, bool is_positional) const override {
    std::string left = "  " + make_option_name(option, is_positional) + make_option_opts(option);
    if (left.size() + 2 > kHelpColumn)
      left += "\n" + std::string(kHelpColumn, ' ');
    else
      left.append(kHelpColumn - left.size(), ' ');
    return left + Wrap(make_option_desc(option), kHelpWidth, kHelpColumn) + "\n";
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

absl::Status EmbeddedOnly(absl::string_view option) {
  return absl::InvalidArgumentError(absl::StrCat(
      option, ": works only without --server; give it to touchstone-server instead (the same option there)"));
}

int PrintError(absl::string_view message) {
  std::fflush(stdout);
  std::fprintf(stderr, "touchstone: error: %s\n", std::string(message).c_str());
  return kBadInput;
}

}  // namespace

Cli::Cli()
    : app_("Touches and photographs objects in simulation, and streams datasets of them to files",
           "touchstone") {
  app_.formatter(std::make_shared<ExamplesFirst>(
      Indented("touchstone objects                                      what can be touched\n"
               "touchstone touch lat20 --approach 0,0,-1                one touch from above\n"
               "touchstone capture lat20 --approach 0,0,-1 -o top.png   its photograph\n"
               "touchstone stream --samples 10000 --out data            a dataset of touches\n"
               "touchstone diagnose set.csv --model nominal.yaml        where and why a model is wrong\n"
               "touchstone doctor                                       is everything in order here?")));
  app_.set_help_flag("-h,--help", "This text; also touchstone COMMAND --help");
  app_.set_version_flag("--version", absl::StrCat("touchstone ", kVersion), "The version");
  app_.require_subcommand(0, 1);
  app_.footer(
      "Without --server the simulation runs in this process; with --server HOST:PORT a running "
      "touchstone-server\n"
      "does it. Both give the same bytes. Exit codes: 0 done, 2 usage or bad input, 3 source unreachable,\n"
      "4 refused or failed by the source, 130 interrupted.");
}

CLI::App* Cli::AddCommand(CLI::App* parent, const std::string& name, const std::string& description,
                          const std::string& examples, std::function<absl::Status()> run) {
  CLI::App* command = (parent == nullptr ? &app_ : parent)->add_subcommand(name, description);
  command->group("Commands");
  command->formatter(std::make_shared<ExamplesFirst>(Indented(examples)));
  command->footer("");
  runs_[command] = std::move(run);
  return command;
}

CLI::App* Cli::AddGroup(const std::string& name, const std::string& description,
                        const std::string& examples) {
  CLI::App* group = app_.add_subcommand(name, description);
  group->group("Commands");
  group->formatter(std::make_shared<ExamplesFirst>(Indented(examples)));
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
    for (const auto& entry : std::filesystem::directory_iterator(source_.mesh_folder, error)) {
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
  std::fwrite(text.data(), 1, text.size(), stdout_taken_ ? stderr : stdout);
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

void Cli::AddSourceOptions(CLI::App* command) {
  const auto add = [&](const std::string& name, auto& value, const std::string& type,
                       const std::string& text) {
    return command->add_option(name, value, text)->type_name(type)->group("Source");
  };
  add("--server", source_.servers, "HOST:PORT",
      "A touchstone-server, or several with commas (the next one takes over from a lost one). "
      "Default: simulate in this process")
      ->delimiter(',')
      ->take_all()
      ->expected(1);
  add("--wait-s", source_.wait_s, "S", "How long to wait for a server that is starting, from 0. Default: 10");
  add("--mesh", source_.meshes, "NAME=FILE",
      "A mesh to touch besides the built-in shapes, repeatable; with what the file does not say: "
      "NAME=FILE,unit=mm|cm|m|inch,up=x|y|z,scale=1,fit_mm=150")
      ->take_all()
      ->expected(1);
  add("--mesh-dir", source_.mesh_folder, "FOLDER", "Every mesh file of a folder, named by its stem");
  add("--renderer", source_.renderer, "KIND",
      "auto, egl or cpu: what makes images. Default: auto, the faster one");
  add("--egl-device", source_.egl_device, "N", "EGL device to render on, as touchstone doctor numbers them");
  add("--threads", source_.threads, "N", "Threads that simulate. Default: one per core");
}

absl::StatusOr<std::unique_ptr<client::Connection>> Cli::Connect() const {
  if (!source_.servers.empty()) {
    const char* embedded_only = !source_.meshes.empty()        ? "--mesh"
                                : !source_.mesh_folder.empty() ? "--mesh-dir"
                                                               : nullptr;
    if (embedded_only != nullptr) return EmbeddedOnly(embedded_only);
    return ConnectWithMeshes({});
  }
  std::vector<source::MeshSpec> meshes;
  if (!source_.mesh_folder.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(meshes, service::MeshSpecsOfFolder(source_.mesh_folder));
  }
  for (const std::string& text : source_.meshes) {
    TOUCHSTONE_ASSIGN_OR_RETURN(source::MeshSpec mesh, service::ParseMeshSpec(text));
    meshes.push_back(std::move(mesh));
  }
  return ConnectWithMeshes(std::move(meshes));
}

absl::StatusOr<std::unique_ptr<client::Connection>> Cli::ConnectNow() const {
  client::ConnectionOptions options;
  options.servers = SplitCommas(source_.servers);
  return client::Connection::Open(std::move(options));
}

absl::StatusOr<std::unique_ptr<client::Connection>> Cli::ConnectWithMeshes(
    std::vector<source::MeshSpec> meshes) const {
  client::ConnectionOptions options;
  options.servers = SplitCommas(source_.servers);
  TOUCHSTONE_RETURN_IF_ERROR(Renderer().status());
  if (!options.servers.empty()) {
    const char* embedded_only = source_.threads != 0      ? "--threads"
                                : source_.egl_device >= 0 ? "--egl-device"
                                                          : nullptr;
    if (embedded_only != nullptr) return EmbeddedOnly(embedded_only);
    if (!(source_.wait_s >= 0 && source_.wait_s <= kMaxWaitS))
      return absl::InvalidArgumentError(
          absl::StrCat("--wait-s: ", ShortestNumber(source_.wait_s), " is out of range; 0 to ", kMaxWaitS));
    options.wait_s = source_.wait_s;
    options.on_wait = [this](const std::string& line) { Log(line); };
    TOUCHSTONE_ASSIGN_OR_RETURN(auto connection, client::Connection::Open(std::move(options)));
    Detail("connected to " + connection->address());
    return connection;
  }
  service::ServerOptions& embedded = options.embedded;
  embedded.meshes = std::move(meshes);
  if (source_.threads < 0)
    return absl::InvalidArgumentError(
        absl::StrCat("--threads: ", source_.threads, "; 1 or more, or 0 for one per core"));
  embedded.threads = source_.threads;
  TOUCHSTONE_ASSIGN_OR_RETURN(embedded.renderer, Renderer());
  return client::Connection::Open(std::move(options));
}

absl::StatusOr<image::RendererOptions> Cli::Renderer() const {
  static const std::map<std::string, image::RendererKind> kinds = {{"auto", image::RendererKind::kAuto},
                                                                   {"egl", image::RendererKind::kEgl},
                                                                   {"cpu", image::RendererKind::kCpu}};
  std::vector<std::string> names;
  for (const auto& [name, kind] : kinds) names.push_back(name);
  TOUCHSTONE_RETURN_IF_ERROR(OneOf("--renderer", source_.renderer, names).status());
  image::RendererOptions options;
  options.kind = kinds.at(source_.renderer);
  options.egl_device = source_.egl_device;
  return options;
}

void Cli::Log(absl::string_view line) const {
  if (!output_.quiet) std::fprintf(stderr, "%s\n", std::string(line).c_str());
}

void Cli::Detail(absl::string_view line) const {
  if (output_.verbose && !output_.quiet) std::fprintf(stderr, "%s\n", std::string(line).c_str());
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
  return PrintError(absl::StrCat(error.what(), help));
}

int Cli::Run(int argc, char** argv) {
  // Last in every help, since they are the same everywhere.
  for (const auto& [command, run] : runs_) AddOutputOptions(const_cast<CLI::App*>(command));
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
  if (run == runs_.end()) {
    // "touchstone" or "touchstone model" alone: what there is, but not as a success.
    std::fprintf(stderr, "%s", app_.help().c_str());
    return kBadInput;
  }
  absl::Status status = CheckFiles(app);
  if (status.ok()) status = run->second();
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
