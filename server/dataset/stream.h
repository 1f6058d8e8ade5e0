// A dataset, or a part of one, as batches in order, computed ahead by a thread pool.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/base/threads/thread_pool.h"
#include "server/dataset/batch_columns.h"
#include "server/dataset/sampler.h"
#include "server/dataset/specification.h"

namespace touchstone::dataset {

// Which samples, and cut how.
struct DatasetPart {
  uint64_t start_index = 0;
  uint64_t stop_index = 0;    // exclusive; 0: to the end
  uint32_t batch_size = 0;    // 0: 4096, or 64 with images
  uint32_t batch_stride = 1;  // after each batch, stride - 1 batches are left out
  // Instead of the dataset in its order these samples, in this order; the indices above then count places in this list.
  std::vector<uint64_t> indices;

  // The part with its defaults filled in, of a dataset with so many samples. OUT_OF_RANGE: beyond its end.
  absl::StatusOr<DatasetPart> Resolved(uint64_t samples, uint32_t default_batch_size) const;
  // The batch that begins at this index or place, below stop_index, without data.
  DatasetBatch BatchAt(uint64_t start) const;
};

// Whose work a stream is, and how much memory its batches may take. Neither changes a sample.
struct StreamShare {
  // `batches`: up to this there may be a batch for every thread where those of the stream are large.
  struct Bytes {
    uint64_t usual = 128 << 20, batches = 128 << 20;
  };
  std::string client;                // in the pool: clients have their turns, and the streams of each
  std::function<Bytes()> max_bytes;  // asked again and again, since it may shrink; none: the above
};

// Fills a run of batches, by the calling thread alone. Sample i is the same in whatever run.
class BatchMaker {
 public:
  explicit BatchMaker(std::shared_ptr<const DatasetSpecification> specification);

  const DatasetSpecification& specification() const { return *specification_; }
  const std::vector<ColumnInfo>& columns() const { return columns_; }

  // batches[k] has start_index and rows set by the caller. CANCELLED soon after `cancelled`.
  absl::Status Make(absl::Span<DatasetBatch> batches, const std::atomic<bool>& cancelled,
                    TouchSampler::Workspace* workspace) const;

 private:
  absl::Status MakeImages(absl::Span<DatasetBatch> batches, const BatchColumns& columns,
                          absl::Span<const touch::TouchPose> poses, const std::atomic<bool>& cancelled) const;

  std::shared_ptr<const DatasetSpecification> specification_;
  std::vector<ColumnInfo> columns_;
  TouchSampler sampler_;
};

class DatasetStream {
 public:
  // Checks the part against the specification (which must be valid).
  static absl::StatusOr<std::unique_ptr<DatasetStream>> Create(
      std::shared_ptr<const DatasetSpecification> specification, const DatasetPart& part, ThreadPool* pool,
      StreamShare share = {});
  ~DatasetStream();  // cancels

  const DatasetSpecification& specification() const;

  // The next batch in order; nothing at the end. Waits for the pool, looking at `cancelled` twenty times a
  // second (may be empty). Not thread-safe.
  absl::StatusOr<std::optional<DatasetBatch>> Next(const std::function<bool()>& cancelled);

 private:
  // A run of batches that one task makes.
  struct Chunk {
    std::vector<DatasetBatch> batches;
    uint64_t samples = 0;
    absl::Status status;
    double took_s = 0;
    bool ready = false;
    size_t taken = 0;
  };
  // What tasks share with the stream; they may outlive it.
  struct Shared;

  DatasetStream() = default;
  static absl::Status MakeChunk(Shared* shared, Chunk* chunk,
                                std::unique_ptr<TouchSampler::Workspace>* workspace);
  void Schedule();
  std::shared_ptr<Chunk> NextChunk();
  void Finish(const Chunk& chunk);
  uint64_t MaxSamples() const;

  std::shared_ptr<Shared> shared_;
  DatasetPart part_;
  ThreadPool* pool_ = nullptr;
  uint64_t number_ = 0;      // in the pool
  uint64_t next_index_ = 0;  // start of the first batch that is not scheduled yet
  StreamShare share_;
  uint64_t bytes_per_sample_ = 1;   // of its columns and of the work on it
  uint64_t chunk_samples_ = 0;      // about, of the next chunk: grows, so that the first batch comes soon
  uint64_t max_chunk_samples_ = 0;  // falls where samples take long
  uint64_t scheduled_samples_ = 0;  // in chunks_
  std::deque<std::shared_ptr<Chunk>> chunks_;
};

}  // namespace touchstone::dataset
