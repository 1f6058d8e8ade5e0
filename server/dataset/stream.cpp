#include "server/dataset/stream.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <exception>
#include <new>

#include "server/base/status.h"
#include "server/base/threads/thread_time.h"

namespace touchstone::dataset {
namespace {

// Samples a task makes: few at first, so that the first batch comes soon; then many, since sorting more
// touches together makes each cheaper.
constexpr uint64_t kFirstChunkSamples = 8192;
constexpr uint64_t kMaxChunkSamples = 524288;
// Of a sample while it is made: its place in the order, keys, numbers (TouchSampler::Workspace).
constexpr uint64_t kWorkBytes = 48;
// The batches of a task come together at its end, so it should not take longer.
constexpr double kMaxTaskS = 0.5;
// Bytes of one batch, safely below the message limit.
constexpr uint64_t kMaxBatchBytes = 192 << 20;

}  // namespace

absl::StatusOr<DatasetPart> DatasetPart::Resolved(uint64_t samples, uint32_t default_batch_size) const {
  for (size_t k = 0; k < indices.size(); ++k)
    if (indices[k] >= samples)
      return absl::OutOfRangeError(absl::StrCat("indices[", k, "] = ", indices[k], ": the dataset has ",
                                                samples, " samples, from 0 on"));
  const uint64_t end = indices.empty() ? samples : indices.size();
  DatasetPart resolved = *this;
  if (resolved.stop_index == 0) resolved.stop_index = end;
  if (resolved.stop_index > end)
    return absl::OutOfRangeError(absl::StrCat("stop_index = ", stop_index, ": ",
                                              indices.empty() ? "the dataset has " : "the list has ", end,
                                              indices.empty() ? " samples" : " indices"));
  if (resolved.batch_size == 0) resolved.batch_size = default_batch_size;
  if (resolved.batch_stride == 0) resolved.batch_stride = 1;
  return resolved;
}

DatasetBatch DatasetPart::BatchAt(uint64_t start) const {
  DatasetBatch batch;
  batch.start_index = start;
  batch.rows = static_cast<uint32_t>(std::min<uint64_t>(batch_size, stop_index - start));
  if (!indices.empty()) batch.indices.assign(indices.begin() + start, indices.begin() + start + batch.rows);
  return batch;
}

struct DatasetStream::Shared {
  explicit Shared(std::shared_ptr<const DatasetSpecification> specification)
      : maker(std::move(specification)) {}

  const BatchMaker maker;
  std::atomic<bool> cancelled{false};
  std::mutex mutex;
  std::condition_variable ready;
  std::vector<std::unique_ptr<TouchSampler::Workspace>> workspaces;  // at rest

  std::unique_ptr<TouchSampler::Workspace> TakeWorkspace() {
    std::lock_guard<std::mutex> lock(mutex);
    if (workspaces.empty()) return std::make_unique<TouchSampler::Workspace>();
    auto workspace = std::move(workspaces.back());
    workspaces.pop_back();
    return workspace;
  }
};

absl::StatusOr<std::unique_ptr<DatasetStream>> DatasetStream::Create(
    std::shared_ptr<const DatasetSpecification> specification, const DatasetPart& part, ThreadPool* pool,
    StreamShare share) {
  std::unique_ptr<DatasetStream> stream(new DatasetStream);
  static std::atomic<uint64_t> streams{0};
  stream->number_ = ++streams;
  stream->shared_ = std::make_shared<Shared>(specification);
  stream->pool_ = pool;
  stream->share_ = std::move(share);
  uint64_t bytes = 0;
  for (const ColumnInfo& column : stream->shared_->maker.columns())
    bytes += column.type == ColumnType::kBytes
                 ? specification->image.options.width * specification->image.options.height
                 : column.BytesPerSample();
  const uint64_t max_rows = std::max<uint64_t>(1, kMaxBatchBytes / bytes);

  const auto default_rows =
      static_cast<uint32_t>(std::min<uint64_t>(specification->columns.image ? 64 : 4096, max_rows));
  TOUCHSTONE_ASSIGN_OR_RETURN(stream->part_, part.Resolved(specification->samples, default_rows));
  if (stream->part_.batch_size > max_rows)
    return absl::InvalidArgumentError(absl::StrCat("batch_size = ", part.batch_size,
                                                   ": a sample of these columns has ", bytes,
                                                   " bytes, so at most ", max_rows, " go into a batch"));
  // A part may be empty: a worker beyond the last batch, or a resumption at the very end.
  stream->next_index_ = part.start_index;
  stream->bytes_per_sample_ = bytes + kWorkBytes;
  stream->max_chunk_samples_ = specification->columns.image ? 64 : kMaxChunkSamples;
  stream->chunk_samples_ = std::min(kFirstChunkSamples, stream->max_chunk_samples_);
  return stream;
}

DatasetStream::~DatasetStream() {
  shared_->cancelled = true;
}

const DatasetSpecification& DatasetStream::specification() const {
  return shared_->maker.specification();
}

// That may be under way, or made and not taken yet.
uint64_t DatasetStream::MaxSamples() const {
  const StreamShare::Bytes bytes = share_.max_bytes ? share_.max_bytes() : StreamShare::Bytes();
  const uint64_t batches = (static_cast<uint64_t>(pool_->size()) + 1) * part_.batch_size;
  return std::max(bytes.usual / bytes_per_sample_, std::min(bytes.batches / bytes_per_sample_, batches));
}

// The batches of the next task; null at the end of the part, or where they find no room beside what is under way.
std::shared_ptr<DatasetStream::Chunk> DatasetStream::NextChunk() {
  const uint64_t max_samples = MaxSamples();
  const uint64_t about = std::min(
      {chunk_samples_, max_chunk_samples_, max_samples / (static_cast<uint64_t>(pool_->size()) + 1)});
  if (!chunks_.empty() && scheduled_samples_ + std::max<uint64_t>(about, part_.batch_size) > max_samples)
    return nullptr;
  auto chunk = std::make_shared<Chunk>();
  uint64_t& samples = chunk->samples;
  while (next_index_ < part_.stop_index && (samples == 0 || samples + part_.batch_size <= about)) {
    DatasetBatch batch = part_.BatchAt(next_index_);
    samples += batch.rows;
    chunk->batches.push_back(std::move(batch));
    const uint64_t step = uint64_t{part_.batch_size} * part_.batch_stride;
    next_index_ = step > part_.stop_index - next_index_ ? part_.stop_index : next_index_ + step;
  }
  if (chunk->batches.empty()) return nullptr;
  chunk_samples_ = std::min(2 * chunk_samples_, kMaxChunkSamples);
  scheduled_samples_ += samples;
  return chunk;
}

// All of its batches were taken.
void DatasetStream::Finish(const Chunk& chunk) {
  scheduled_samples_ -= chunk.samples;
  if (chunk.took_s <= kMaxTaskS) return;
  const double fitting = chunk.samples * kMaxTaskS / chunk.took_s;
  max_chunk_samples_ = std::min(max_chunk_samples_, std::max<uint64_t>(1, static_cast<uint64_t>(fitting)));
}

// In a thread of the pool, where an exception would end the process.
absl::Status DatasetStream::MakeChunk(Shared* shared, Chunk* chunk,
                                      std::unique_ptr<TouchSampler::Workspace>* workspace) {
  if (shared->cancelled) return absl::CancelledError("the stream was cancelled");
  try {
    *workspace = shared->TakeWorkspace();
    return shared->maker.Make(absl::MakeSpan(chunk->batches), shared->cancelled, workspace->get());
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("there is not enough memory for this stream: try again later");
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("the stream ended with an unexpected error: ", error.what()));
  }
}

// Keeps one task a thread under way and one waiting.
void DatasetStream::Schedule() {
  while (chunks_.size() < static_cast<size_t>(pool_->size()) + 1) {
    std::shared_ptr<Chunk> chunk = NextChunk();
    if (chunk == nullptr) return;
    chunks_.push_back(chunk);
    pool_->Submit(
        [shared = shared_, chunk] {
          const double begin_s = ThreadTimeS();
          std::unique_ptr<TouchSampler::Workspace> workspace;
          const absl::Status status = MakeChunk(shared.get(), chunk.get(), &workspace);
          std::lock_guard<std::mutex> lock(shared->mutex);
          if (workspace != nullptr) shared->workspaces.push_back(std::move(workspace));
          chunk->status = status;
          chunk->took_s = ThreadTimeS() - begin_s;
          chunk->ready = true;
          shared->ready.notify_all();
        },
        share_.client, number_);
  }
}

absl::StatusOr<std::optional<DatasetBatch>> DatasetStream::Next(const std::function<bool()>& cancelled) {
  if (!chunks_.empty() && chunks_.front()->taken == chunks_.front()->batches.size()) {
    Finish(*chunks_.front());
    chunks_.pop_front();
  }
  Schedule();
  if (chunks_.empty()) return std::optional<DatasetBatch>();

  Chunk& chunk = *chunks_.front();
  if (chunk.taken == 0) {
    std::unique_lock<std::mutex> lock(shared_->mutex);
    while (!chunk.ready) {
      if (cancelled && cancelled()) return absl::CancelledError("the stream was cancelled");
      shared_->ready.wait_for(lock, std::chrono::milliseconds(50));
    }
    if (!chunk.status.ok()) return chunk.status;
  }
  return std::optional<DatasetBatch>(std::move(chunk.batches[chunk.taken++]));
}

}  // namespace touchstone::dataset
