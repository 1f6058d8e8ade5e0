// touchstone.v1.Source of a physical source: a rig, or the record of one. What it shares with the virtual one
// (objects, plans, checks of a request) is that one's code.
#pragma once

#include "server/dataset/specification.h"
#include "server/image/image.h"
#include "server/service/source_service.h"
#include "server/source/rig_device.h"

namespace touchstone {

class PhysicalSourceService final : public SourceService {
 public:
  PhysicalSourceService(Resources* resources, LeaseBook* leases, RigDevice* source)
      : SourceService(resources, leases), source_(source) {}

  grpc::Status Describe(grpc::ServerContext*, const v1::DescribeRequest*, v1::DescribeResponse*) override;
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

  RigDevice* source_;
};

// A journalled touch as the protocol tells it. Times of fingers that reported nothing are NaN.
v1::TouchResult ToProto(const JournalTouch& touch, const std::string& session);

// A picture as an image specification asks for it. INVALID_ARGUMENT for what a camera has not: depth, mask,
// another look.
absl::StatusOr<Image> PictureOf(const Frame& frame, const Intrinsics& intrinsics, const DatasetImage& wanted);

// Camera of the protocol (eye, at, up) as object_from_camera: z looks ahead, y down.
Eigen::Isometry3d ObjectFromCamera(const Camera& camera);

}  // namespace touchstone
