#include "server/service/rpc/source_service.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <optional>

#include "server/base/status.h"
#include "server/service/calls/call_guard.h"
#include "server/service/calls/source_messages.h"
#include "server/service/core/convert.h"

namespace touchstone::service {
namespace {

// The answer of a call that may have failed.
template <typename Response>
grpc::Status Answer(absl::StatusOr<Response> result, Response* response) {
  if (result.ok()) *response = *std::move(result);
  return ToGrpc(result.status());
}

// All streams together may take a quarter of the memory that calls may use: requests, answers and diagnoses need some too.
dataset::StreamShare ShareOf(const std::string& client, const Resources* resources) {
  dataset::StreamShare share;
  share.client = client;
  share.max_bytes = [resources] {
    const uint64_t streams = std::max<uint32_t>(1, resources->streams->taken());
    const uint64_t fair = std::max<uint64_t>(1 << 20, resources->memory->bytes() / 4 / streams);
    const uint64_t usual = uint64_t{1 << 20} * resources->options.stream_memory_mib;
    return dataset::StreamShare::Bytes{std::min(usual, fair), fair};
  };
  return share;
}

// What a batch takes while it is sent: itself, its copy on the way, and about as much of the work on the next one.
uint64_t BytesToSend(uint64_t bytes_of_batch) {
  return 3 * bytes_of_batch;
}

uint64_t BytesOf(const dataset::DatasetBatch& batch) {
  uint64_t bytes = 0;
  for (const std::string& column : batch.data) bytes += column.size();
  return bytes;
}

// The same before it is made, as far as it was asked for: a size that the source chooses itself is a small one, and pictures
// that are packed have no size yet.
uint64_t BytesAskedFor(const source::SampleHeader& header, const dataset::DatasetPart& part) {
  uint64_t bytes = 0;
  for (const dataset::ColumnInfo& column : header.columns) bytes += column.BytesPerSample();
  const uint64_t samples = part.indices.empty() ? header.samples : part.indices.size();
  return bytes * std::min<uint64_t>(part.batch_size, samples);
}

// Whether a stream can end within the time of draining; one that cannot is handed over at once, with a status on which
// clients go on at another server or at this one when it is back.
class Handover {
 public:
  Handover(const dataset::DatasetPart& part, uint64_t samples, const Clock& clock)
      : clock_(clock),
        stop_(part.stop_index > 0    ? part.stop_index
              : part.indices.empty() ? samples
                                     : part.indices.size()),
        stride_(std::max<uint32_t>(1, part.batch_stride)),
        next_(part.start_index) {}

  // The speed is measured from the first batch on: what comes before it, such as an object's tree, is made once.
  void Sent(uint64_t start, uint32_t rows) {
    if (sent_)
      rows_ += rows;
    else
      first_batch_ = clock_.Now();
    sent_ = true;
    next_ = start + rows;
  }
  absl::Status Check(double drain_s) const {
    if (!sent_) return absl::OkStatus();
    const double running_s = clock_.SecondsSince(first_batch_);
    if (running_s < kMinRunningS) return absl::OkStatus();  // its speed is not known yet
    const double left = next_ < stop_ ? static_cast<double>(stop_ - next_) / stride_ : 0;
    if (left <= rows_ / running_s * drain_s) return absl::OkStatus();
    return absl::UnavailableError(absl::StrCat(
        "this source is being shut down, and about ", static_cast<uint64_t>(left),
        " samples are left: go on with sample ", next_, " at another one, or here when it is back"));
  }

 private:
  static constexpr double kMinRunningS = 0.5;
  const Clock& clock_;
  const uint64_t stop_;
  const uint32_t stride_;
  uint64_t next_;
  uint64_t rows_ = 0;  // after the first batch
  bool sent_ = false;
  Clock::Time first_batch_;  // once it was sent
};

}  // namespace

grpc::Status SourceService::Describe(grpc::ServerContext*, const v1::DescribeRequest*,
                                     v1::DescribeResponse* response) {
  *response = ToProto(source_->Describe(), resources_->options);
  return grpc::Status::OK;
}

grpc::Status SourceService::ListObjects(grpc::ServerContext*, const v1::ListObjectsRequest*,
                                        v1::ListObjectsResponse* response) {
  *response = ToProto(source_->objects());
  return grpc::Status::OK;
}

grpc::Status SourceService::ExpandPlan(grpc::ServerContext* context, const v1::ExpandPlanRequest* message,
                                       v1::ExpandPlanResponse* response) {
  const absl::StatusOr<source::PlanRequest> request = FromProto(*message, *resources_);
  if (!request.ok()) return ToGrpc(request.status());
  // Nothing moves, so nobody needs a lease; a client that is gone needs no answer.
  const source::MotionGuard guard = [context,
                                     in_time = TimeGuardOf(resources_->options, false)]() -> absl::Status {
    if (!context->IsCancelled()) return in_time();
    return absl::CancelledError("the client is gone, or the call's deadline has passed");
  };
  const absl::StatusOr<source::ExpandedPlan> plan = source_->ExpandPlan(*request, guard);
  if (!plan.ok()) return ToGrpc(plan.status());
  *response = ToProto(*plan);
  return grpc::Status::OK;
}

grpc::Status SourceService::Touch(grpc::ServerContext* context, const v1::TouchRequest* message,
                                  v1::TouchResponse* response) {
  return Answer(DoTouch(context, *message), response);
}

absl::StatusOr<v1::TouchResponse> SourceService::DoTouch(grpc::ServerContext* context,
                                                         const v1::TouchRequest& message) {
  const RunningGuard running(&resources_->running_requests);
  TOUCHSTONE_RETURN_IF_ERROR(leases_->Check(message.lease_token()));
  const source::MotionGuard guard = StoppableGuardOf(context, resources_, leases_, message.lease_token());
  TOUCHSTONE_ASSIGN_OR_RETURN(const source::TouchRequest request, FromProto(message, *resources_));
  TOUCHSTONE_ASSIGN_OR_RETURN(const source::TouchResults results, source_->Touch(request, guard));
  resources_->touches += results.size();
  return ToProto(results);
}

grpc::Status SourceService::Capture(grpc::ServerContext* context, const v1::CaptureRequest* message,
                                    v1::CaptureResponse* response) {
  return Answer(DoCapture(context, *message), response);
}

absl::StatusOr<v1::CaptureResponse> SourceService::DoCapture(grpc::ServerContext* context,
                                                             const v1::CaptureRequest& message) {
  const RunningGuard running(&resources_->running_requests);
  TOUCHSTONE_RETURN_IF_ERROR(leases_->Check(message.lease_token()));
  const source::MotionGuard guard = StoppableGuardOf(context, resources_, leases_, message.lease_token());
  TOUCHSTONE_ASSIGN_OR_RETURN(const source::CaptureRequest request, FromProto(message, *resources_));
  TOUCHSTONE_ASSIGN_OR_RETURN(source::CaptureResults results, source_->Capture(request, guard));
  resources_->images += results.batch.rows;
  return ToProto(std::move(results));
}

grpc::Status SourceService::StreamDataset(grpc::ServerContext* context,
                                          const v1::StreamDatasetRequest* message,
                                          grpc::ServerWriter<v1::StreamDatasetResponse>* writer) {
  return ToGrpc(DoStream(context, *message, writer));
}

absl::Status SourceService::DoStream(grpc::ServerContext* context, const v1::StreamDatasetRequest& message,
                                     grpc::ServerWriter<v1::StreamDatasetResponse>* writer) {
  const std::string client = ClientOf(*context);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Places::Place place, resources_->streams->Take(client));
  const RunningGuard running(&resources_->running_streams);
  TOUCHSTONE_RETURN_IF_ERROR(leases_->Check(message.lease_token()));
  const source::MotionGuard guard = GuardOf(context, resources_, leases_, message.lease_token());
  TOUCHSTONE_ASSIGN_OR_RETURN(source::SampleRequest request, FromProto(message, *resources_));
  request.share = ShareOf(client, resources_);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<source::SampleStream> stream, source_->Stream(request));
  // Of the largest batch so far. Where there is no room for one it is refused before it is made.
  uint64_t reserved = BytesToSend(BytesAskedFor(stream->header(), request.part));
  TOUCHSTONE_ASSIGN_OR_RETURN(MemoryBudget::Reservation memory, resources_->memory->Reserve(reserved));
  StallWatch::Call call(resources_->stalls.get(), context);
  v1::StreamDatasetResponse response;
  const auto write = [&] { return writer->Write(response); };
  *response.mutable_header() = ToProto(stream->header());
  if (!call.Wait(write)) return absl::CancelledError("the client is gone");
  response.clear_header();
  Handover handover(request.part, stream->header().samples, *resources_->options.clock);
  for (;;) {
    if (resources_->draining) TOUCHSTONE_RETURN_IF_ERROR(handover.Check(resources_->options.drain_s));
    TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<dataset::DatasetBatch> batch, stream->Next(guard));
    if (!batch.has_value()) return absl::OkStatus();
    if (const uint64_t bytes = BytesToSend(BytesOf(*batch)); bytes > reserved) {
      TOUCHSTONE_RETURN_IF_ERROR(memory.Grow(bytes - reserved));
      reserved = bytes;
    }
    const uint32_t rows = batch->rows;
    handover.Sent(batch->start_index, rows);
    *response.mutable_batch() = ToProto(*std::move(batch), stream->header().columns);
    if (!call.Wait(write)) return absl::CancelledError("the client is gone");
    resources_->samples += rows;
    resources_->touches += rows;
    if (request.specification.columns.image) resources_->images += rows;
  }
}

}  // namespace touchstone::service
