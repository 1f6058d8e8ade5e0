// touchstone.v1.Source over any source: converts, calls, converts.
#pragma once

#include "server/service/calls/lease_book.h"
#include "server/service/core/resources.h"
#include "server/source/source.h"
#include "touchstone/v1/source.grpc.pb.h"

namespace touchstone::service {

class SourceService final : public v1::Source::Service {
 public:
  SourceService(Resources* resources, LeaseBook* leases, source::Source* source)
      : resources_(resources), leases_(leases), source_(source) {}

  grpc::Status Describe(grpc::ServerContext*, const v1::DescribeRequest*, v1::DescribeResponse*) override;
  grpc::Status ListObjects(grpc::ServerContext*, const v1::ListObjectsRequest*,
                           v1::ListObjectsResponse*) override;
  grpc::Status ExpandPlan(grpc::ServerContext*, const v1::ExpandPlanRequest*,
                          v1::ExpandPlanResponse*) override;
  grpc::Status Touch(grpc::ServerContext*, const v1::TouchRequest*, v1::TouchResponse*) override;
  grpc::Status Capture(grpc::ServerContext*, const v1::CaptureRequest*, v1::CaptureResponse*) override;
  grpc::Status StreamDataset(grpc::ServerContext*, const v1::StreamDatasetRequest*,
                             grpc::ServerWriter<v1::StreamDatasetResponse>*) override;

 private:
  absl::StatusOr<v1::TouchResponse> DoTouch(grpc::ServerContext* context, const v1::TouchRequest& message);
  absl::StatusOr<v1::CaptureResponse> DoCapture(grpc::ServerContext* context,
                                                const v1::CaptureRequest& message);
  absl::Status DoStream(grpc::ServerContext* context, const v1::StreamDatasetRequest& message,
                        grpc::ServerWriter<v1::StreamDatasetResponse>* writer);

  Resources* resources_;
  LeaseBook* leases_;
  source::Source* source_;
};

}  // namespace touchstone::service
