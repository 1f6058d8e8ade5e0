// The physical source: what a rig, or the recording of one, makes touch by touch, as the protocol wants it.
#pragma once

#include <functional>
#include <memory>

#include "server/source/rig_device.h"
#include "server/source/source.h"

namespace touchstone::source {

// Scales a photograph to width x height pixels of a vertical field of view (radians), without distortion, as a
// virtual source renders it: rgb or grey.
using Rectifier =
    std::function<std::vector<uint8_t>(const image::Frame& frame, const image::Intrinsics& intrinsics,
                                       int width, int height, double vertical_fov_rad, bool grey)>;

// The nominal model of a rig's end effector: what decides before a touch whether its fingers will hit.
std::shared_ptr<const model::Model> NominalModelOf(const RigDevice& device);

class PhysicalSource final : public Source {
 public:
  // `objects` must outlive the source.
  PhysicalSource(const ObjectStore* objects, const SourceLimits& limits, std::unique_ptr<RigDevice> device,
                 Rectifier rectify)
      : Source(objects, limits), device_(std::move(device)), rectify_(std::move(rectify)) {}

  SourceInfo Describe() const override;
  RigDevice& device() const { return *device_; }

 protected:
  std::shared_ptr<const model::Model> OwnModel() const override { return NominalModelOf(*device_); }
  // Every touch is checked before the first one moves anything.
  absl::StatusOr<TouchResults> MakeTouches(const TouchRequest& request, const ServedObject& object,
                                           const MotionGuard& guard) override;
  absl::Status MakePictures(const CaptureRequest& request, const ServedObject& object,
                            const MotionGuard& guard, const TakePicture& take) override;
  // Sample i is journalled under the request's key and i, so that it is made once and given again whenever the
  // dataset, or a part of it, is asked for in the same session.
  absl::StatusOr<std::unique_ptr<SampleStream>> MakeStream(const SampleRequest& request) override;

 private:
  const std::unique_ptr<RigDevice> device_;
  const Rectifier rectify_;
};

// A photograph as an image specification asks for it.
image::Image ImageOf(const Photograph& photograph, const RigDevice& device, const Rectifier& rectify,
                     const dataset::DatasetImage& wanted);

// INVALID_ARGUMENT for what a camera does not have: depth, mask, another shading style.
absl::Status CheckPhotograph(const dataset::DatasetImage& wanted);

// Camera of the protocol (eye, at, up) as object_from_camera: z looks ahead, y down.
Eigen::Isometry3d ObjectFromCamera(const image::Camera& camera);

}  // namespace touchstone::source
