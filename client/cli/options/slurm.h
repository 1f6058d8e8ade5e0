// A dataset by many machines: the array job that has Slurm run `touchstone stream --shards K/N`, a part of the shards a
// task.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "client/cli/common/common.h"
#include "client/source/dataset_writer.h"

namespace touchstone::cli {

struct SlurmFlags {
  bool submit = false;
  bool dry_run = false;              // the script alone
  uint64_t max_tasks = 0;            // of the array; 0: kDefaultSlurmTasks
  std::vector<std::string> options;  // of sbatch, "--partition=gpu"
};

// Slurm allows array indices up to MaxArraySize - 1, by default 1000.
inline constexpr uint64_t kDefaultSlurmTasks = 1000;

// What the script of an array says.
struct SlurmArray {
  std::string program;                 // absolute path
  std::vector<std::string> arguments;  // of `touchstone`, without those that are of Slurm
  std::string folder;                  // absolute: of the dataset
  uint64_t tasks = 0;                  // N of --shards K/N
  std::vector<uint64_t> indices;       // K of those with something left to do, in order
  std::vector<std::string> options;    // of sbatch
  bool limit_threads =
      false;  // the source runs in the task, which has as many threads as Slurm gave it cores
};

// "0-3,7,9-10" of numbers in order.
std::string SlurmIndices(const std::vector<uint64_t>& indices);

// The words without --slurm, its options with their values, and --restart, which happens once and before.
std::vector<std::string> WithoutSlurm(const std::vector<std::string>& words);

// The script for sbatch. A task that Slurm starts again (a node died) resumes; one whose server cannot be reached asks for
// that itself, ten times at most; any other error ends it.
std::string SlurmScript(const SlurmArray& array);

// Finds out what is left to do of `job`, writes FOLDER/slurm/array.sh for it, and hands it to sbatch. INVALID_ARGUMENT where
// another run writes there or the dataset is another one, UNAVAILABLE where sbatch cannot be run or refuses.
absl::Status SubmitToSlurm(const Cli& cli, const SlurmFlags& flags, client::Connection* connection,
                           client::DatasetJob job);

// `shards`: --shards, which is the array's to say.
void AddSlurmOptions(CLI::App* command, SlurmFlags* flags, CLI::Option* shards);

}  // namespace touchstone::cli
