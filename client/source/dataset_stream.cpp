#include "client/source/dataset_stream.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"

namespace touchstone::client {
namespace {

// The stream may resume only where the same request means the same bytes.
absl::Status CompareHeaders(const v1::DatasetHeader& before, const v1::DatasetHeader& now,
                            const std::string& address) {
  const auto differs = [&](const char* what, const auto& a, const auto& b) {
    return absl::FailedPreconditionError(absl::StrCat("the stream cannot resume at ", address, ": its ", what,
                                                      " is ", b, ", it was ", a,
                                                      "; the rest would not fit the beginning"));
  };
  if (before.model_hash() != now.model_hash())
    return differs("model hash", before.model_hash(), now.model_hash());
  if (before.version() != now.version()) return differs("version", before.version(), now.version());
  if (before.samples() != now.samples()) return differs("number of samples", before.samples(), now.samples());
  if (before.renderer() != now.renderer())
    return differs("renderer", v1::RendererKind_Name(before.renderer()),
                   v1::RendererKind_Name(now.renderer()));
  if (before.mesh_hashes_size() != now.mesh_hashes_size())
    return differs("number of objects", before.mesh_hashes_size(), now.mesh_hashes_size());
  for (int i = 0; i < before.mesh_hashes_size(); ++i)
    if (before.mesh_hashes(i) != now.mesh_hashes(i))
      return differs("mesh hash", before.mesh_hashes(i), now.mesh_hashes(i));
  return absl::OkStatus();
}

}  // namespace

DatasetStream::DatasetStream(Connection* connection, v1::StreamDatasetRequest request,
                             DatasetStreamOptions options)
    : connection_(connection), request_(std::move(request)), options_(std::move(options)) {}

DatasetStream::~DatasetStream() {
  if (reader_ == nullptr) return;
  Cancel();
  CloseReader().IgnoreError();
}

absl::StatusOr<std::unique_ptr<DatasetStream>> DatasetStream::Open(Connection* connection,
                                                                   v1::StreamDatasetRequest request,
                                                                   DatasetStreamOptions options) {
  std::unique_ptr<DatasetStream> stream(
      new DatasetStream(connection, std::move(request), std::move(options)));
  TOUCHSTONE_RETURN_IF_ERROR(stream->Reconnect(stream->Start()));
  return stream;
}

absl::Status DatasetStream::Start() {
  {
    std::lock_guard<std::mutex> lock(context_mutex_);
    if (cancelled_) return absl::CancelledError("the stream was cancelled");
    context_ = std::make_unique<grpc::ClientContext>();
  }
  if (options_.lease != nullptr && options_.lease->required())
    request_.set_lease_token(options_.lease->token());
  reader_ = connection_->source().StreamDataset(context_.get(), request_);
  v1::StreamDatasetResponse first;
  if (!reader_->Read(&first)) {
    const absl::Status status = CloseReader();
    return status.ok() ? absl::InternalError("the source ended the dataset before its header") : status;
  }
  if (!first.has_header()) return absl::InternalError("the source began the dataset without a header");
  if (have_header_) return CompareHeaders(header_, first.header(), connection_->address());

  // What the first server chose for itself is asked of every later one: its model, whole, and its renderer.
  header_ = first.header();
  have_header_ = true;
  if (!header_.model_yaml().empty()) request_.mutable_spec()->mutable_model()->set_yaml(header_.model_yaml());
  if (header_.renderer() != v1::RENDERER_KIND_UNSPECIFIED)
    request_.mutable_spec()->mutable_image()->set_renderer(header_.renderer());
  return absl::OkStatus();
}

absl::StatusOr<bool> DatasetStream::Next(Batch* batch) {
  while (true) {
    if (reader_ == nullptr) return false;
    if (reader_->Read(&batch->message_)) {
      if (!batch->message_.has_batch())
        return absl::InternalError("the source sent a message without a batch in the middle of a dataset");
      // Where the stream would resume after this batch if the server were lost now.
      if (request_.batch_size() > 0)
        batch_rows_ = request_.batch_size();
      else
        batch_rows_ = std::max(batch_rows_, batch->rows());
      const uint64_t stride = std::max<uint64_t>(1, request_.batch_stride());
      request_.set_start_index(batch->start_index() + (stride == 1 ? batch->rows() : batch_rows_ * stride));
      return true;
    }
    const absl::Status status = CloseReader();
    if (cancelled_) return absl::CancelledError("the stream was cancelled");
    if (status.ok()) return false;
    // Why the lease was lost says more than that it is stale.
    if (absl::IsAborted(status) && options_.lease != nullptr && !options_.lease->status().ok())
      return options_.lease->status();
    // Nobody here has cancelled: the server ended what was left of a drain, or a stream that nobody read for long.
    const absl::Status lost = LostWhereCancelled(status);
    if (!IsLostServer(lost) && !IsFullServer(lost)) return status;
    // Lost after the last batch but before the goodbye: there is nothing left to ask for.
    const uint64_t stop = request_.stop_index() > 0 ? request_.stop_index() : header_.samples();
    if (request_.start_index() >= stop) return false;
    TOUCHSTONE_RETURN_IF_ERROR(Reconnect(lost));
  }
}

absl::Status DatasetStream::Reconnect(absl::Status lost) {
  RetryOptions retry;
  retry.retry_for_s = options_.reconnect_s;
  retry.clock = options_.clock;
  retry.log = options_.log;
  retry.wait = [this](double seconds) {
    std::unique_lock<std::mutex> lock(context_mutex_);
    return !options_.clock->WaitFor(lock, cancellation_, seconds, [this] { return cancelled_.load(); });
  };
  const auto attempt = [this] {
    if (options_.lease != nullptr) TOUCHSTONE_RETURN_IF_ERROR(options_.lease->Follow(connection_));
    TOUCHSTONE_RETURN_IF_ERROR(Start());
    if (options_.log)
      options_.log(
          absl::StrCat("resuming at ", connection_->address(), " with sample ", request_.start_index()));
    return absl::OkStatus();
  };
  return connection_->RetryingAfter(std::move(lost), attempt, retry);
}

absl::Status DatasetStream::CloseReader() {
  // Reads to the end what a cancelled call still has in store: gRPC demands it before Finish.
  v1::StreamDatasetResponse rest;
  while (reader_->Read(&rest)) {
  }
  const absl::Status status = FromGrpc(reader_->Finish());
  reader_.reset();
  std::lock_guard<std::mutex> lock(context_mutex_);
  context_.reset();
  return status;
}

void DatasetStream::Cancel() {
  std::lock_guard<std::mutex> lock(context_mutex_);
  cancelled_ = true;
  cancellation_.notify_all();
  if (context_ != nullptr) context_->TryCancel();
}

}  // namespace touchstone::client
