#include "client/cli/options/slurm.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_replace.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>

#include "client/cli/common/provenance.h"
#include "server/base/files/file_writer.h"
#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

// Options without and with a value that a task must not see again.
constexpr const char* kSlurmFlags[] = {"--slurm", "--slurm-dry-run", "--restart"};
constexpr const char* kSlurmValues[] = {"--slurm-tasks", "--slurm-option"};

// What sbatch said, both streams; UNAVAILABLE with it if it failed.
absl::StatusOr<std::string> RunSbatch(const std::string& script) {
  std::FILE* pipe = ::popen(absl::StrCat("sbatch --parsable ", ShellWord(script), " 2>&1").c_str(), "r");
  if (pipe == nullptr) return absl::UnavailableError("sbatch: cannot be started");
  std::string output;
  std::array<char, 4096> piece;
  while (const size_t size = std::fread(piece.data(), 1, piece.size(), pipe))
    output.append(piece.data(), size);
  const int status = ::pclose(pipe);
  absl::StripAsciiWhitespace(&output);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return output;
  if (WIFEXITED(status) && WEXITSTATUS(status) == 127)
    return absl::UnavailableError(
        "--slurm: there is no sbatch here; run this where jobs are submitted, or use --slurm-dry-run and "
        "submit the script there");
  return absl::UnavailableError(absl::StrCat("--slurm: sbatch refused ", script, ": ", output));
}

// One name a dataset: Slurm then starts an array only when an earlier one of the same dataset has ended.
std::string JobName(const std::string& folder) {
  return absl::StrCat("touchstone-", Sha256Hex(folder).substr(0, 12));
}

absl::StatusOr<SlurmArray> MakeArray(const Cli& cli, const SlurmFlags& flags, const client::DatasetJob& job,
                                     const std::vector<uint64_t>& missing, uint64_t shards) {
  SlurmArray array;
  std::error_code error;
  array.program = fs::read_symlink("/proc/self/exe", error).string();
  array.folder = fs::absolute(job.folder, error).lexically_normal().string();
  if (error) return absl::InternalError(absl::StrCat("--slurm: ", error.message()));
  array.arguments = WithoutSlurm(cli.arguments());
  array.tasks = std::min(shards, flags.max_tasks == 0 ? kDefaultSlurmTasks : flags.max_tasks);
  std::vector<bool> needed(array.tasks);
  for (const uint64_t shard : missing) needed[shard % array.tasks] = true;
  for (uint64_t k = 0; k < array.tasks; ++k)
    if (needed[k]) array.indices.push_back(k);
  array.options = flags.options;
  array.limit_threads = cli.source().servers.empty() && cli.source().threads == 0;
  return array;
}

}  // namespace

std::string SlurmIndices(const std::vector<uint64_t>& indices) {
  std::vector<std::string> ranges;
  for (size_t i = 0; i < indices.size();) {
    size_t last = i;
    while (last + 1 < indices.size() && indices[last + 1] == indices[last] + 1) ++last;
    ranges.push_back(last == i ? absl::StrCat(indices[i]) : absl::StrCat(indices[i], "-", indices[last]));
    i = last + 1;
  }
  return absl::StrJoin(ranges, ",");
}

std::vector<std::string> WithoutSlurm(const std::vector<std::string>& words) {
  std::vector<std::string> kept;
  for (size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (std::find(std::begin(kSlurmFlags), std::end(kSlurmFlags), word) != std::end(kSlurmFlags)) continue;
    const bool has_value = std::find(std::begin(kSlurmValues), std::end(kSlurmValues),
                                     word.substr(0, word.find('='))) != std::end(kSlurmValues);
    if (!has_value) kept.push_back(word);
    if (has_value && !absl::StrContains(word, '=')) ++i;
  }
  return kept;
}

std::string SlurmScript(const SlurmArray& array) {
  std::string command = ShellWord(array.program);
  for (const std::string& word : array.arguments) absl::StrAppend(&command, " ", ShellWord(word));
  absl::StrAppend(&command, " --shards \"$SLURM_ARRAY_TASK_ID/", array.tasks, "\"");
  if (array.limit_threads) absl::StrAppend(&command, " --threads \"${SLURM_CPUS_ON_NODE:-0}\"");
  // % in a file name has a meaning for Slurm.
  const std::string folder = absl::StrReplaceAll(array.folder, {{"%", "%%"}});
  std::string script = absl::StrCat(
      "#!/bin/bash\n"
      "# A dataset as an array job, written by `touchstone stream --slurm`. Each task writes its part of "
      "the\n"
      "# shards; one that is started again reads those that stand and makes the rest. The task that ends "
      "last\n"
      "# writes dataset.json.\n"
      "#SBATCH --job-name=",
      JobName(array.folder),
      "\n#SBATCH --dependency=singleton\n#SBATCH --array=", SlurmIndices(array.indices),
      "\n#SBATCH --output=\"", folder, "/slurm/%a.log\"\n#SBATCH --open-mode=append\n#SBATCH --requeue\n");
  for (const std::string& option : array.options) absl::StrAppend(&script, "#SBATCH ", option, "\n");
  absl::StrAppend(&script, command, "\nstatus=$?\n",
                  "# 3: no server could be reached, which passes. Everything else would fail again.\n"
                  "if [ \"$status\" = 3 ] && [ \"${SLURM_RESTART_COUNT:-0}\" -lt 10 ]; then\n"
                  "  scontrol requeue \"$SLURM_JOB_ID\"\n"
                  "fi\n"
                  "exit \"$status\"\n");
  return script;
}

absl::Status SubmitToSlurm(const Cli& cli, const SlurmFlags& flags, client::Connection* connection,
                           client::DatasetJob job) {
  for (const std::string& option : flags.options)
    if (!absl::StartsWith(option, "-") || absl::StrContains(option, '\n'))
      return absl::InvalidArgumentError(
          absl::StrCat("--slurm-option: '", option, "' is no option of sbatch, such as --partition=gpu"));
  client::DatasetWriter writer(connection, job);
  writer.on_log = [&](const std::string& line) { cli.Log(line); };
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<uint64_t> missing, writer.Plan());
  const uint64_t shards = missing.size() + writer.result().shards_found;
  Json json = {{"folder", job.folder},
               {"shards", shards},
               {"shards_found", writer.result().shards_found},
               {"tasks", 0},
               {"complete", missing.empty()}};
  if (missing.empty()) {
    if (cli.output().json) PrintJson(json);
    cli.Log(absl::StrCat("nothing to submit: all ", Counted(shards, "shard", "shards"), " of ", job.folder,
                         " stand"));
    return absl::OkStatus();
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const SlurmArray array, MakeArray(cli, flags, job, missing, shards));
  const std::string script = absl::StrCat(array.folder, "/slurm/array.sh");
  std::error_code error;
  fs::create_directories(fs::path(script).parent_path(), error);
  TOUCHSTONE_RETURN_IF_ERROR(WriteFileAtomically(script, SlurmScript(array)));
  json["tasks"] = array.indices.size();
  json["script"] = script;
  const std::string what = absl::StrCat(Counted(array.indices.size(), "task", "tasks"), " for ",
                                        Counted(missing.size(), "shard", "shards"), " of ", shards);
  if (flags.dry_run) {
    cli.Log(absl::StrCat("wrote ", script, ": ", what, "; submit it with sbatch ", ShellWord(script)));
  } else {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string id, RunSbatch(script));
    json["slurm_job"] = id;
    cli.Log(absl::StrCat("submitted job ", id, ": ", what, "; output in ", array.folder,
                         "/slurm/*.log. The same command submits again what is then missing; touchstone "
                         "dataset verify ",
                         ShellWord(job.folder), " reads every byte"));
  }
  if (cli.output().json) PrintJson(json);
  return absl::OkStatus();
}

void AddSlurmOptions(CLI::App* command, SlurmFlags* flags, CLI::Option* shards) {
  const char* group = "Slurm";
  CLI::Option* slurm =
      command
          ->add_flag("--slurm", flags->submit,
                     "Have a Slurm cluster write it: submits an array job, a shard per task, for what is "
                     "not finished. --out lies where every node sees it")
          ->group(group);
  slurm->excludes(shards);
  command
      ->add_option("--slurm-tasks", flags->max_tasks,
                   "Tasks of the array at most; with more shards a task writes several. Default: 1000")
      ->type_name("N")
      ->group(group)
      ->needs(slurm);
  command
      ->add_option("--slurm-option", flags->options,
                   "Option of sbatch, --slurm-option=--partition=gpu; may be repeated")
      ->type_name("OPTION")
      ->group(group)
      ->needs(slurm)
      ->take_all()
      ->expected(1);
  command->add_flag("--slurm-dry-run", flags->dry_run, "Write the script, OUT/slurm/array.sh, and no more")
      ->group(group)
      ->needs(slurm);
}

}  // namespace touchstone::cli
