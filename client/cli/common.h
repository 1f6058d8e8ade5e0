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

#include "client/source/connection.h"

namespace touchstone::cli {

using Json = nlohmann::ordered_json;

// 0 done, 2 usage or bad input, 3 source unreachable, 4 refused or failed by the source, 130 interrupted.
enum ExitCode { kDone = 0, kBadInput = 2, kUnreachable = 3, kRefused = 4, kInterrupted = 130 };
ExitCode ExitCodeOf(const absl::Status& status);

// Options of every command.
struct OutputOptions {
  bool json = false;
  bool quiet = false;
  bool verbose = false;
};

// Where touches come from: servers, or a source in this process with these meshes and this renderer.
struct SourceOptions {
  std::vector<std::string> servers;
  std::vector<std::string> meshes;
  std::string mesh_folder;
  std::string renderer = "auto";
  int egl_device = -1;
  int threads = 0;
};

class Cli {
 public:
  Cli();

  // A command under `parent` (null: touchstone itself). Examples stand first in its help, one a line.
  CLI::App* AddCommand(CLI::App* parent, const std::string& name, const std::string& description,
                       const std::string& examples, std::function<absl::Status()> run);
  // A command that only holds others ("model").
  CLI::App* AddGroup(const std::string& name, const std::string& description, const std::string& examples);

  // --server, --mesh, ...: for commands that need a source.
  void AddSourceOptions(CLI::App* command);
  // The source that those options name.
  absl::StatusOr<std::unique_ptr<client::Connection>> Connect() const;
  // The same, with these meshes in place of --mesh and --mesh-dir where the source is in this process; a
  // server has its own, and the caller may send these along.
  absl::StatusOr<std::unique_ptr<client::Connection>> ConnectWithMeshes(std::vector<MeshSource> meshes) const;
  const SourceOptions& source() const { return source_; }
  const OutputOptions& output() const { return output_; }

  // A line to stderr: Log unless --quiet, Detail only with --verbose.
  void Log(absl::string_view line) const;
  void Detail(absl::string_view line) const;

  // Parses and runs; prints the error, if any, and returns the exit code.
  int Run(int argc, char** argv);

 private:
  void AddOutputOptions(CLI::App* command);
  int UsageError(const CLI::ParseError& error, int argc, char** argv);
  std::string HelpCommand() const;  // "touchstone model add" of what was typed so far

  CLI::App app_;
  OutputOptions output_;
  SourceOptions source_;
  std::map<const CLI::App*, std::function<absl::Status()>> runs_;
};

// --- Input
// -----------------------------------------------------------------------------------------------------

// Three numbers, "0,0,-1"; `name` stands in errors.
absl::StatusOr<v1::Vector3> ParseVector(const std::string& name, const std::string& text);

// A model as the user names it: a file (its text goes along), a hash of at least 8 digits, or a name that the
// source knows. Empty: the source's default.
absl::StatusOr<v1::ModelRef> ParseModelRef(const std::string& text);

// "a,b,c" and repeated options alike.
std::vector<std::string> SplitCommas(const std::vector<std::string>& texts);

// The one of `known` that `text` is; the error offers the nearest.
absl::StatusOr<std::string> OneOf(const std::string& name, const std::string& text,
                                  const std::vector<std::string>& known);

// --- Output
// ----------------------------------------------------------------------------------------------------

// Columns of text, each as wide as its widest cell, two blanks between them; the last one is broken into
// lines.
class Table {
 public:
  explicit Table(std::vector<std::string> header) : rows_{std::move(header)} {}
  void Add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  std::string Text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

// Text broken into lines of at most `width` columns, all but the first indented.
std::string Wrap(absl::string_view text, size_t width, size_t indent);

// Four significant digits, for people: "0.05", "149.9", "1.2e-06", "21860".
std::string Rounded(double value);

// "1 shard", "7 shards".
std::string Counted(uint64_t count, const std::string& one, const std::string& many);

void PrintJson(const Json& json);

// Writes a file whole or not at all; "-" or empty is stdout.
absl::Status WriteOutput(const std::string& path, const std::string& data);

// --- Commands: one file each
// -----------------------------------------------------------------------------------
void AddObjects(Cli* cli);
void AddEffects(Cli* cli);
void AddModel(Cli* cli);
void AddPlan(Cli* cli);
void AddTouch(Cli* cli);
void AddCapture(Cli* cli);
void AddStream(Cli* cli);
void AddMesh(Cli* cli);
void AddCompare(Cli* cli);
void AddDiagnose(Cli* cli);
void AddPropose(Cli* cli);
void AddSession(Cli* cli);
void AddRig(Cli* cli);
void AddDoctor(Cli* cli);

}  // namespace touchstone::cli
