// touchstone.v1.Source of the virtual source.
#pragma once

#include "server/service/control_service.h"
#include "server/service/resources.h"
#include "touchstone/v1/source.grpc.pb.h"

namespace touchstone {

class SourceService : public v1::Source::Service {
 public:
  SourceService(Resources* resources, LeaseBook* leases) : resources_(resources), leases_(leases) {}

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
  absl::Status DoTouch(grpc::ServerContext* context, const v1::TouchRequest& request,
                       v1::TouchResponse* response);
  absl::Status DoCapture(grpc::ServerContext* context, const v1::CaptureRequest& request,
                         v1::CaptureResponse* response);
  absl::Status DoStream(grpc::ServerContext* context, const v1::StreamDatasetRequest& request,
                        grpc::ServerWriter<v1::StreamDatasetResponse>* writer);
  absl::Status Ready(uint64_t stops_before) const;

 protected:
  Resources* resources_;
  LeaseBook* leases_;
};

}  // namespace touchstone
