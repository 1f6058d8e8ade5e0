// Writes a dataset into a folder: shards and dataset.json. Interrupted in any way, the next run with the same
// specification resumes at the first missing shard, and the result is the same, byte for byte.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "client/source/connection/connection.h"
#include "client/source/dataset/dataset_manifest.h"
#include "client/source/dataset/shard_writer.h"
#include "client/source/dataset_stream.h"

namespace touchstone::client {

// What to write. Parallel jobs (job_count > 1) share the folder: job k writes shards k, k + job_count, ...;
// the one that finishes last writes dataset.json.
struct DatasetJob {
  v1::DatasetSpec spec;
  ShardFormat format = ShardFormat::kWebDataset;
  std::string folder;
  uint64_t shard_size = 10000;
  uint32_t batch_size = 0;  // of the stream, 0: the source's own; changes no byte
  uint64_t job_index = 0;
  uint64_t job_count = 1;
  bool restart = false;  // forget what the folder holds of a dataset
  double reconnect_s = kRetryForS;
  std::string session;           // that a physical source journals the touches in; empty: its default
  LeaseKeeper* lease = nullptr;  // of a source that needs one; outlives the job
};

struct DatasetProgress {
  uint64_t samples_done = 0;  // of this job, those of earlier runs included
  uint64_t samples_in_job = 0;
  uint64_t samples_this_run = 0;
};

struct DatasetResult {
  uint64_t samples_in_dataset = 0;
  uint64_t samples_written = 0;   // by this run
  uint64_t draws = 0;             // that they took, rejected ones included; 0: the source does not say
  uint64_t shards_written = 0;    // by this run
  uint64_t shards_found = 0;      // of this job, whole already
  bool dataset_complete = false;  // all jobs' shards are there, dataset.json says "complete"
};

class DatasetWriter {
 public:
  DatasetWriter(Connection* connection, DatasetJob job);
  ~DatasetWriter();

  // From the thread that runs Run.
  std::function<void(const DatasetProgress&)> on_progress;
  std::function<void(const std::string&)> on_log;

  // What is left to do: the numbers of the shards that are not finished, in order. Reads every finished one, as Run
  // does, and writes dataset.json, so that parallel jobs that start later make the same dataset by the same renderer; then
  // lets go of the folder. For a job that is alone (job_count 1).
  absl::StatusOr<std::vector<uint64_t>> Plan();

  // CANCELLED after Cancel: finished shards stay, and dataset.json (or the job's own file) lists them.
  absl::Status Run();
  const DatasetResult& result() const { return result_; }

  // Safe from any thread.
  void Cancel();

 private:
  class FolderLock;

  absl::Status CheckJob() const;
  absl::Status PrepareFolder();
  absl::Status Resolve();  // asks the source what the dataset is
  absl::Status FindFinishedShards();
  absl::StatusOr<bool> IsWhole(uint64_t shard, const std::map<uint64_t, FinishedShard>& listed);
  absl::Status WriteShards(uint64_t first_shard, uint64_t stop_shard);
  absl::Status WriteManifest();
  absl::Status CompleteTogether();  // parallel jobs: dataset.json once all shards are there
  void RemoveJobManifests();
  std::string ManifestPath() const;  // of this job
  bool Mine(uint64_t shard) const { return shard % job_.job_count == job_.job_index; }
  absl::StatusOr<std::unique_ptr<DatasetStream>> OpenStream(uint64_t start_index, uint64_t stop_index,
                                                            uint32_t batch_size);

  Connection* connection_;
  DatasetJob job_;
  DatasetLayout layout_;
  DatasetManifest manifest_;
  DatasetResult result_;
  DatasetProgress progress_;
  std::chrono::steady_clock::time_point manifest_written_;
  std::unique_ptr<FolderLock> lock_;
  v1::DatasetSpec request_spec_;  // as asked, with the model and the renderer that the source resolved
  std::atomic<bool> cancelled_{false};
  std::mutex stream_mutex_;  // guards running_ against Cancel
  DatasetStream* running_ = nullptr;
};

}  // namespace touchstone::client
