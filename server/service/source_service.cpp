#include "server/service/source_service.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/service/call_guard.h"
#include "server/service/convert.h"
#include "server/service/source_messages.h"

namespace touchstone::service {
namespace {

// The answer of a call that may have failed.
template <typename Response>
grpc::Status Answer(absl::StatusOr<Response> result, Response* response) {
  if (result.ok()) *response = *std::move(result);
  return ToGrpc(result.status());
}

}  // namespace

grpc::Status SourceService::Describe(grpc::ServerContext*, const v1::DescribeRequest*,
                                     v1::DescribeResponse* response) {
  *response = ToProto(source_->Describe(), source_->limits());
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
  const source::MotionGuard guard = [context]() -> absl::Status {
    if (!context->IsCancelled()) return absl::OkStatus();
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
  const RunningGuard running(&resources_->running_streams);
  if (resources_->running_streams > static_cast<uint32_t>(resources_->options.max_streams))
    return absl::ResourceExhaustedError(
        absl::StrCat("this source runs ", resources_->options.max_streams,
                     " dataset streams already (max_streams): try again later, or at another one"));
  TOUCHSTONE_RETURN_IF_ERROR(leases_->Check(message.lease_token()));
  const source::MotionGuard guard = GuardOf(context, resources_, leases_, message.lease_token());
  TOUCHSTONE_ASSIGN_OR_RETURN(const source::SampleRequest request, FromProto(message, *resources_));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<source::SampleStream> stream, source_->Stream(request));
  v1::StreamDatasetResponse response;
  *response.mutable_header() = ToProto(stream->header());
  if (!writer->Write(response)) return absl::CancelledError("the client is gone");
  response.clear_header();
  for (;;) {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::optional<dataset::DatasetBatch> batch, stream->Next(guard));
    if (!batch.has_value()) return absl::OkStatus();
    const uint32_t rows = batch->rows;
    *response.mutable_batch() = ToProto(*std::move(batch), stream->header().columns);
    if (!writer->Write(response)) return absl::CancelledError("the client is gone");
    resources_->touches += rows;
    if (request.specification.columns.image) resources_->images += rows;
  }
}

}  // namespace touchstone::service
