// What the commands share: options, output, errors, interruption. A command is one file that adds itself to
// the Cli: its options, its examples and the function that runs it.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/strings/str_cat.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "client/cli/common/exit_code.h"
#include "client/cli/common/output_file.h"
#include "client/source/connection/connection.h"

namespace touchstone::cli {

using Json = nlohmann::ordered_json;

// Options of every command.
struct OutputOptions {
  bool json = false;
  bool force = false;  // replace files that exist
  bool quiet = false;
  bool verbose = false;
};

// Where touches come from: servers, or a source in this process with these meshes and this renderer.
struct SourceOptions {
  std::vector<std::string> servers;
  bool servers_from_environment = false;  // TOUCHSTONE_SERVER names them
  std::string rig;                        // a gateway beside them; empty: none
  client::Credentials credentials;        // what those servers are shown
  std::vector<std::string> meshes;
  std::string mesh_folder;
  double wait_s = 10;  // for a server that is starting
  std::string renderer = "auto";
  int egl_device = -1;
  int threads = 0;
};

class Cli {
 public:
  Cli();

  // A command under `parent` (null: touchstone itself). Examples stand first in its help, one per line.
  CLI::App* AddCommand(CLI::App* parent, const std::string& name, const std::string& description,
                       const std::string& examples, std::function<absl::Status()> run);
  // A command of another program: `run` is given every word behind its name, help and options too. `options` are for
  // completion alone.
  CLI::App* AddForwarded(const std::string& name, const std::string& description,
                         std::vector<std::string> options,
                         std::function<absl::Status(const std::vector<std::string>&)> run);
  // Runs a command of another program, or nothing if it is none: then false.
  bool Forward(const CLI::App* command, const std::vector<std::string>& arguments,
               absl::Status* status) const;
  // A command that only holds others ("model").
  CLI::App* AddGroup(const std::string& name, const std::string& description, const std::string& examples);

  // An option that names a file which the command writes, with --force beside it. Before the command runs, all
  // of its outputs are checked (output_file.h).
  CLI::Option* AddOutput(CLI::App* command, const std::string& name, std::string* path,
                         const std::string& text, OutputKind kind = OutputKind::kFile);
  // The same where --json is another format of this output and not a text beside it.
  CLI::Option* AddFormattedOutput(CLI::App* command, const std::string& name, std::string* path,
                                  const std::string& text);
  // The option names files that the command reads: none of its outputs may be one of them.
  void AddInput(CLI::App* command, const CLI::Option* option);
  // The same check for outputs whose names the command makes up, before its work.
  absl::Status CheckOutputs(const std::vector<OutputFile>& outputs) const;
  // Writes an output; empty and "-" are standard output.
  absl::Status Write(const std::string& path, absl::string_view data) const;
  // For people: to stdout, or to stderr where an output of the command is standard output.
  absl::Status Print(absl::string_view text) const;
  // "wrote report.html", unless it went to standard output.
  void LogWritten(const std::string& path, absl::string_view details = "") const;

  // --server, --mesh, ...: for commands that need a source.
  void AddSourceOptions(CLI::App* command);
  // --server, --wait-s and what a server is shown: for commands that need a rig.
  void AddRigOptions(CLI::App* command);
  // --rig, beside the options of a source.
  void AddRigBeside(CLI::App* command);
  // The source that those options name.
  absl::StatusOr<std::unique_ptr<client::Connection>> Connect() const;
  // The gateway of --rig.
  absl::StatusOr<std::unique_ptr<client::Connection>> ConnectToRigBeside() const;
  // The same at a server, without --wait-s: for what must not wait.
  absl::StatusOr<std::unique_ptr<client::Connection>> ConnectNow() const;
  // As Connect, with these meshes in place of --mesh and --mesh-dir where the source is in this process; a
  // server has its own, and the caller may send these along.
  absl::StatusOr<std::unique_ptr<client::Connection>> ConnectWithMeshes(
      std::vector<source::MeshSpec> meshes) const;
  // All commands with their options.
  const CLI::App& app() const { return app_; }
  // Names of the options that a command takes, "--out" and "-o".
  std::vector<std::string> OptionsOf(const CLI::App* command) const;
  const SourceOptions& source() const { return source_; }
  // What --renderer and --egl-device say; INVALID_ARGUMENT for an unknown kind.
  absl::StatusOr<image::RendererOptions> Renderer() const;
  const OutputOptions& output() const { return output_; }
  // What was typed, as a shell takes it.
  const std::string& command_line() const { return command_line_; }
  // The same in words, without the program.
  const std::vector<std::string>& arguments() const { return arguments_; }

  // A line to stderr: Log unless --quiet, Detail only with --verbose.
  void Log(absl::string_view line) const;
  void Detail(absl::string_view line) const;
  // Also with --quiet: what was asked for and is not done.
  void Warn(absl::string_view line) const;

  // Parses and runs; prints the error, if any, and returns the exit code.
  int Run(int argc, char** argv);

 private:
  // What a command reads and writes, by its options.
  struct CommandFiles {
    struct Output {
      const CLI::Option* option;
      OutputKind kind;
      bool json_is_a_format;
    };
    std::vector<Output> outputs;
    std::vector<const CLI::Option*> inputs;
  };
  struct ForwardedCommand {
    std::vector<std::string> options;
    std::function<absl::Status(const std::vector<std::string>&)> run;
  };
  absl::Status CheckFiles(const CLI::App* command);
  CLI::Option* AddOutputOf(CLI::App* command, const std::string& name, std::string* path,
                           const std::string& text, OutputKind kind, bool json_is_a_format);
  void AddOutputOptions(CLI::App* command);
  void AddServerOptions(CLI::App* command, const std::string& what);
  // After parsing: TOUCHSTONE_SERVER where --server was left out, and none of them after --server none.
  absl::Status ChooseServers(const CLI::App* command);
  // What is wrong with an option that only a simulation in this process has.
  absl::Status EmbeddedOnly(absl::string_view option) const;
  void AddCredentialOptions(CLI::App* command);
  absl::Status CheckWait() const;
  absl::StatusOr<std::unique_ptr<client::Connection>> ConnectToServers(
      std::vector<std::string> servers) const;
  int UsageError(const CLI::ParseError& error, int argc, char** argv);
  std::string HelpCommand() const;  // "touchstone model add" of what was typed so far

  CLI::App app_;
  OutputOptions output_;
  SourceOptions source_;
  std::map<const CLI::App*, std::function<absl::Status()>> runs_;
  std::map<const CLI::App*, ForwardedCommand> forwarded_;
  std::map<const CLI::App*, CommandFiles> files_;
  std::string command_line_;
  std::vector<std::string> arguments_;
  std::vector<std::string> inputs_;  // paths that the running command reads
  bool stdout_taken_ = false;        // an output of the running command is standard output
};

// --- Input

// Three numbers, "0,0,-1"; `name` stands in errors.
absl::StatusOr<v1::Vector3> ParseVector(const std::string& name, const std::string& text);
// The same in millimetres, as metres.
absl::StatusOr<v1::Vector3> ParseMillimetres(const std::string& name, const std::string& text);

// A model as the user names it: a file (its text goes along), a hash of at least 8 digits, or a name that the
// source knows. Empty: the source's default.
absl::StatusOr<v1::ModelRef> ParseModelRef(const std::string& text);

// "a,b,c" and repeated options alike.
std::vector<std::string> SplitCommas(const std::vector<std::string>& texts);

// The one of `known` that `text` is; the error offers the nearest.
absl::StatusOr<std::string> OneOf(const std::string& name, const std::string& text,
                                  const std::vector<std::string>& known);

// --- Output

// Columns of text, each as wide as its widest cell, two blanks between them. Where that is wider than the terminal, cells of
// the widest columns are wrapped; a word stays whole.
class Table {
 public:
  explicit Table(std::vector<std::string> header) : rows_{std::move(header)} {}
  void Add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  std::string Text() const;

 private:
  std::vector<size_t> Widths() const;

  std::vector<std::vector<std::string>> rows_;
};

// Four significant digits, for people: "0.05", "149.9", "1.2e-06", "21860".
std::string Rounded(double value);

// "1 shard", "7 shards".
std::string Counted(uint64_t count, const std::string& one, const std::string& many);
// "2026-11-28 04:30:54 UTC"
std::string UtcText(double unix_s);
// "8 of 12 touches come from the gateway's journal, made at 2026-11-28 04:30:54 UTC"; `first_unix_s`: when the first of them
// began, 0: unknown.
std::string FromJournalText(size_t count, size_t all, double first_unix_s);

void PrintJson(const Json& json);

// --- Commands: one file each
void AddDemo(Cli* cli);
void AddObjects(Cli* cli);
void AddEffects(Cli* cli);
void AddModel(Cli* cli);
void AddPlan(Cli* cli);
void AddTouch(Cli* cli);
void AddCapture(Cli* cli);
void AddStream(Cli* cli);
void AddDataset(Cli* cli);
void AddMesh(Cli* cli);
void AddNormalize(Cli* cli);
void AddCompare(Cli* cli);
void AddDiagnose(Cli* cli);
void AddCheck(Cli* cli);
void AddRehearse(Cli* cli);
void AddExplain(Cli* cli);
void AddUncertainty(Cli* cli);
void AddHistory(Cli* cli);
void AddModelPromote(Cli* cli, CLI::App* group);
void AddPropose(Cli* cli);
void AddWorkbench(Cli* cli);
void AddSession(Cli* cli);
void AddRig(Cli* cli);
void AddToken(Cli* cli);
void AddDoctor(Cli* cli);
void AddPythonCommands(Cli* cli);  // export, import, ...: the table is in python_command.cpp
void AddHelp(Cli* cli);            // help, version, completion

}  // namespace touchstone::cli
