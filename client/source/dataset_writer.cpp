#include "client/source/dataset_writer.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <filesystem>

#include "client/source/dataset/dataset_folder.h"
#include "client/source/dataset/synced_file.h"
#include "server/base/files/file_writer.h"
#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::client {
namespace {

namespace fs = std::filesystem;

constexpr double kManifestIntervalS = 1;
constexpr char kHowToGoOn[] = "Use another folder, or --restart to delete what is there";

}  // namespace

// Keeps two runs from writing the same shards: one run alone, or parallel jobs with numbers of their own.
class DatasetWriter::FolderLock {
 public:
  ~FolderLock() {
    for (const int descriptor : descriptors_) ::close(descriptor);
    if (!path_.empty()) ::unlink(path_.c_str());
  }

  absl::Status Take(const DatasetJob& job) {
    TOUCHSTONE_RETURN_IF_ERROR(
        TakeOne(job.folder, O_RDONLY | O_DIRECTORY, job.job_count == 1 ? LOCK_EX : LOCK_SH));
    if (job.job_count == 1) return absl::OkStatus();
    const std::string path =
        absl::StrCat(job.folder, "/.job-", job.job_index, "-of-", job.job_count, ".lock");
    TOUCHSTONE_RETURN_IF_ERROR(TakeOne(path, O_RDWR | O_CREAT | O_NOFOLLOW, LOCK_EX));
    path_ = path;
    return absl::OkStatus();
  }

 private:
  absl::Status TakeOne(const std::string& path, int flags, int operation) {
    const int descriptor = OpenFile(path, flags, 0666);
    if (descriptor < 0) return FileError(errno, path, "cannot be opened");
    descriptors_.push_back(descriptor);
    if (::flock(descriptor, operation | LOCK_NB) == 0) return absl::OkStatus();
    if (errno == EWOULDBLOCK)
      return absl::InvalidArgumentError(absl::StrCat(path,
                                                     ": another run is writing there now. Wait for it, use "
                                                     "another folder, or share the work with --shards"));
    return absl::OkStatus();  // a file system without locks
  }

  std::vector<int> descriptors_;
  std::string path_;
};

DatasetWriter::DatasetWriter(Connection* connection, DatasetJob job)
    : connection_(connection), job_(std::move(job)), request_spec_(job_.spec) {}

DatasetWriter::~DatasetWriter() = default;

void DatasetWriter::Cancel() {
  std::lock_guard<std::mutex> lock(stream_mutex_);
  cancelled_ = true;
  if (running_ != nullptr) running_->Cancel();
}

std::string DatasetWriter::ManifestPath() const {
  if (job_.job_count == 1) return absl::StrCat(job_.folder, "/", kManifestName);
  return absl::StrCat(job_.folder, "/dataset.job-", job_.job_index, "-of-", job_.job_count, ".json");
}

absl::Status DatasetWriter::CheckJob() const {
  if (job_.shard_size == 0) return absl::InvalidArgumentError("--shard-size: 0; at least 1 sample per shard");
  if (job_.job_count == 0 || job_.job_index >= job_.job_count)
    return absl::InvalidArgumentError(absl::StrCat("--shards: ", job_.job_index, "/", job_.job_count,
                                                   "; the first number goes from 0 to the second less one"));
  if (job_.restart && job_.job_count > 1)
    return absl::InvalidArgumentError(
        "--restart with --shards would delete the other jobs' shards; empty the folder "
        "before the jobs start");
  return absl::OkStatus();
}

absl::StatusOr<std::vector<uint64_t>> DatasetWriter::Plan() {
  if (job_.job_count != 1) return absl::InternalError("Plan is for a job that is alone");
  TOUCHSTONE_RETURN_IF_ERROR(CheckJob());
  TOUCHSTONE_RETURN_IF_ERROR(PrepareFolder());
  TOUCHSTONE_RETURN_IF_ERROR(Resolve());
  TOUCHSTONE_RETURN_IF_ERROR(FindFinishedShards());
  TOUCHSTONE_RETURN_IF_ERROR(WriteManifest());
  std::vector<uint64_t> missing;
  for (uint64_t shard = 0; shard < layout_.ShardCount(); ++shard)
    if (manifest_.shards.count(shard) == 0) missing.push_back(shard);
  result_.dataset_complete = missing.empty();
  if (missing.empty()) RemoveJobManifests();
  lock_.reset();
  return missing;
}

absl::Status DatasetWriter::Run() {
  TOUCHSTONE_RETURN_IF_ERROR(CheckJob());
  TOUCHSTONE_RETURN_IF_ERROR(PrepareFolder());
  TOUCHSTONE_RETURN_IF_ERROR(Resolve());
  TOUCHSTONE_RETURN_IF_ERROR(FindFinishedShards());

  // Runs of missing shards: each is one stream.
  const uint64_t shards = layout_.ShardCount();
  const auto missing = [&](uint64_t shard) { return Mine(shard) && manifest_.shards.count(shard) == 0; };
  absl::Status status = WriteManifest();
  for (uint64_t first = 0; status.ok() && first < shards; ++first) {
    if (!missing(first)) continue;
    uint64_t stop = first + 1;
    while (stop < shards && missing(stop)) ++stop;
    status = WriteShards(first, stop);
    first = stop - 1;
  }
  // Whatever ended the run: what is finished is written down.
  const absl::Status written = WriteManifest();
  TOUCHSTONE_RETURN_IF_ERROR(status);
  TOUCHSTONE_RETURN_IF_ERROR(written);
  if (job_.job_count > 1) return CompleteTogether();
  result_.dataset_complete = true;
  return absl::OkStatus();
}

absl::Status DatasetWriter::PrepareFolder() {
  std::error_code error;
  fs::create_directories(job_.folder, error);
  if (error)
    return absl::InvalidArgumentError(
        absl::StrCat("--out: ", job_.folder, " cannot be made: ", error.message()));
  if (::access(job_.folder.c_str(), W_OK | X_OK) != 0)
    return absl::InvalidArgumentError(
        absl::StrCat("--out: ", job_.folder, " may not be written: ", std::strerror(errno)));
  lock_ = std::make_unique<FolderLock>();
  TOUCHSTONE_RETURN_IF_ERROR(lock_->Take(job_));
  if (job_.restart)
    for (const fs::path& path : ListFolder(job_.folder))
      if (IsShardName(path.filename().string()) || IsManifestName(path.filename().string())) {
        fs::remove_all(path, error);
        if (error) return FileError(error.value(), path.string(), "cannot be deleted");
      }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<DatasetStream>> DatasetWriter::OpenStream(uint64_t start_index,
                                                                         uint64_t stop_index,
                                                                         uint32_t batch_size) {
  if (cancelled_) return absl::CancelledError("interrupted");
  v1::StreamDatasetRequest request;
  *request.mutable_spec() = request_spec_;
  request.set_start_index(start_index);
  request.set_stop_index(stop_index);
  request.set_batch_size(batch_size);
  DatasetStreamOptions options;
  options.reconnect_s = job_.reconnect_s;
  options.log = on_log;
  options.lease = job_.lease;
  request.set_session(job_.session);
  return DatasetStream::Open(connection_, std::move(request), options);
}

absl::Status DatasetWriter::Resolve() {
  // A dataset begun by one renderer is finished by it.
  if (request_spec_.image().renderer() == v1::RENDERER_KIND_UNSPECIFIED && request_spec_.has_image()) {
    for (const fs::path& path : ListFolder(job_.folder)) {
      if (!IsWholeManifest(path)) continue;
      TOUCHSTONE_ASSIGN_OR_RETURN(const DatasetManifest before, ReadManifest(path));
      request_spec_.mutable_image()->set_renderer(RendererOfName(before.identity.value("renderer", "")));
      break;
    }
  }
  // One sample is enough: the header comes with it.
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<DatasetStream> stream, OpenStream(0, 1, 1));
  const v1::DatasetHeader& header = stream->header();
  if (header.samples() == 0)
    return absl::InvalidArgumentError("--samples: 0; a dataset has at least one sample");

  layout_.format = job_.format;
  layout_.folder = job_.folder;
  layout_.samples = header.samples();
  layout_.shard_size = job_.shard_size;
  layout_.objects.assign(job_.spec.objects().begin(), job_.spec.objects().end());
  layout_.fingers = static_cast<int>(header.fingers());
  layout_.image_extension = job_.spec.image().encoding() == v1::IMAGE_ENCODING_JPEG ? "jpg" : "png";
  for (const v1::Column& column : header.columns()) layout_.columns.push_back(FileColumnOf(column));
  manifest_.identity = MakeIdentity(job_.spec, header, layout_);

  if (!header.model_yaml().empty()) request_spec_.mutable_model()->set_yaml(header.model_yaml());
  if (header.renderer() != v1::RENDERER_KIND_UNSPECIFIED)
    request_spec_.mutable_image()->set_renderer(header.renderer());
  return absl::OkStatus();
}

absl::Status DatasetWriter::FindFinishedShards() {
  // Every manifest in the folder must be of this very dataset.
  bool any_manifest = false;
  std::map<uint64_t, FinishedShard> listed;
  for (const fs::path& path : ListFolder(job_.folder)) {
    if (!IsWholeManifest(path)) continue;
    const absl::StatusOr<DatasetManifest> before = ReadManifest(path);
    if (absl::IsNotFound(before.status()) && job_.job_count > 1)
      continue;  // another job has just completed the dataset
    TOUCHSTONE_RETURN_IF_ERROR(before.status());
    const std::vector<std::string> differences = DiffIdentities(before->identity, manifest_.identity);
    if (!differences.empty())
      return absl::InvalidArgumentError(absl::StrCat(
          path.string(), " is another dataset: ", absl::StrJoin(differences, "; "), ". ", kHowToGoOn));
    any_manifest = true;
    listed.insert(before->shards.begin(), before->shards.end());
  }
  if (!any_manifest)
    for (const fs::path& path : ListFolder(job_.folder))
      if (IsShardName(path.filename().string()) && path.extension() != kPartSuffix && job_.job_count == 1)
        return absl::InvalidArgumentError(absl::StrCat(path.string(), " stands there, but no ", kManifestName,
                                                       " says of what dataset. ", kHowToGoOn));

  for (uint64_t shard = 0; shard < layout_.ShardCount(); ++shard) {
    if (!Mine(shard)) continue;
    progress_.samples_in_job += layout_.SamplesIn(shard);
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool whole, IsWhole(shard, listed));
    if (!whole) continue;
    manifest_.shards[shard] = listed.at(shard);
    progress_.samples_done += layout_.SamplesIn(shard);
    ++result_.shards_found;
  }
  result_.samples_in_dataset = layout_.samples;
  return absl::OkStatus();
}

// A shard counts when its bytes are those that were written: every one is read. One of which no manifest says anything was
// finished just before a run was killed, or is anybody's: it is made again.
absl::StatusOr<bool> DatasetWriter::IsWhole(uint64_t shard, const std::map<uint64_t, FinishedShard>& listed) {
  const fs::path path = fs::path(job_.folder) / layout_.ShardName(shard);
  std::error_code error;
  if (!fs::exists(path, error)) return false;
  const auto known = listed.find(shard);
  if (known == listed.end()) {
    fs::remove_all(path, error);
    if (error) return FileError(error.value(), path.string(), "cannot be deleted");
    return false;
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const FinishedShard found, ReadFinishedShard(layout_, shard));
  const std::string difference = DifferenceOf(found, known->second);
  if (difference.empty()) return true;
  return absl::InvalidArgumentError(
      absl::StrCat(path.string(), " ", difference, ": it was changed. Delete it, and it will be made again"));
}

absl::Status DatasetWriter::WriteShards(uint64_t first_shard, uint64_t stop_shard) {
  const uint64_t stop_index = layout_.FirstIndex(stop_shard - 1) + layout_.SamplesIn(stop_shard - 1);
  uint64_t next_index = layout_.FirstIndex(first_shard);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<DatasetStream> stream,
                              OpenStream(next_index, stop_index, job_.batch_size));
  {
    std::lock_guard<std::mutex> lock(stream_mutex_);
    running_ = stream.get();
    if (cancelled_) running_->Cancel();
  }
  const auto forget_stream = [this](void*) {
    std::lock_guard<std::mutex> lock(stream_mutex_);
    running_ = nullptr;
  };
  const std::unique_ptr<void, decltype(forget_stream)> guard(this, forget_stream);

  uint64_t shard = first_shard;
  std::unique_ptr<ShardWriter> writer;
  Batch batch;
  while (next_index < stop_index) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool more, stream->Next(&batch));
    if (!more || batch.start_index() != next_index || batch.rows() == 0)
      return absl::InternalError(absl::StrCat("the source ", more ? "skipped from" : "ended the dataset at",
                                              " sample ", next_index, "; ", stop_index, " were asked for"));
    // A batch may end in the middle of a shard, or hold several.
    for (uint64_t row = 0; row < batch.rows();) {
      if (writer == nullptr) {
        TOUCHSTONE_ASSIGN_OR_RETURN(writer, CreateShardWriter(layout_, shard));
      }
      const uint64_t shard_stop = layout_.FirstIndex(shard) + layout_.SamplesIn(shard);
      const uint64_t rows = std::min(batch.rows() - row, shard_stop - next_index);
      TOUCHSTONE_RETURN_IF_ERROR(writer->Append(batch, row, rows));
      row += rows;
      next_index += rows;
      if (next_index < shard_stop) continue;
      TOUCHSTONE_ASSIGN_OR_RETURN(manifest_.shards[shard], writer->Finish());
      writer.reset();
      ++shard;
      ++result_.shards_written;
      const std::chrono::duration<double> unlisted = std::chrono::steady_clock::now() - manifest_written_;
      if (unlisted.count() >= kManifestIntervalS) TOUCHSTONE_RETURN_IF_ERROR(WriteManifest());
    }
    result_.samples_written += batch.rows();
    result_.draws += batch.message().draws();
    progress_.samples_done += batch.rows();
    progress_.samples_this_run += batch.rows();
    if (on_progress) on_progress(progress_);
  }
  return absl::OkStatus();
}

absl::Status DatasetWriter::WriteManifest() {
  manifest_written_ = std::chrono::steady_clock::now();
  const bool complete = job_.job_count == 1 && manifest_.shards.size() == layout_.ShardCount();
  return WriteFileAtomically(ManifestPath(), FormatManifest(manifest_, complete));
}

absl::Status DatasetWriter::CompleteTogether() {
  // The merged manifest is a pure function of the shards, so that two jobs that end at the same time write
  // the same file; the jobs' own files go once it stands.
  DatasetManifest merged = manifest_;
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<DatasetManifest> others, ReadManifests(job_.folder));
  for (const DatasetManifest& other : others) merged.shards.insert(other.shards.begin(), other.shards.end());
  if (merged.shards.size() < layout_.ShardCount()) return absl::OkStatus();
  TOUCHSTONE_RETURN_IF_ERROR(
      WriteFileAtomically(absl::StrCat(job_.folder, "/", kManifestName), FormatManifest(merged, true)));
  RemoveJobManifests();
  result_.dataset_complete = true;
  return absl::OkStatus();
}

void DatasetWriter::RemoveJobManifests() {
  std::error_code ignored;
  for (const fs::path& path : ListFolder(job_.folder))
    if (IsWholeManifest(path) && path.filename() != kManifestName) fs::remove(path, ignored);
}

}  // namespace touchstone::client
