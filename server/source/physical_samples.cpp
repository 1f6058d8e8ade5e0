#include "server/source/physical_samples.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/numbers/nan.h"
#include "server/base/status.h"
#include "server/session/journal/command_bytes.h"
#include "server/source/physical_source.h"
#include "server/touch/batch_row.h"

namespace touchstone::source {
namespace {

// A touch as a batch of one, for the table of columns: what a rig does not measure is NaN.
effects::TouchBatch BatchOf(const TouchCommand& command, const session::JournalTouch& touch, uint64_t index) {
  effects::TouchBatch batch;
  batch.Reset(1, static_cast<int>(touch.result.fingers.size()));
  touch::SetTouch(command.touch, index, 0, &batch);
  for (int finger = 0; finger < batch.fingers(); ++finger)
    batch.reported_time_s[finger] = touch.result.fingers[finger].contact_time_s;
  std::fill(batch.contact_m.begin(), batch.contact_m.end(), Eigen::Vector3d::Constant(kNaN));
  std::fill(batch.normal.begin(), batch.normal.end(), Eigen::Vector3d::Constant(kNaN));
  return batch;
}

bool EveryFingerHit(const session::JournalTouch& touch) {
  return std::none_of(touch.result.fingers.begin(), touch.result.fingers.end(),
                      [](const session::JournalFinger& finger) { return std::isnan(finger.contact_time_s); });
}

}  // namespace

absl::StatusOr<std::unique_ptr<SampleStream>> PhysicalSamples::Create(const SampleRequest& request,
                                                                      RigDevice* device, Rectifier rectify) {
  std::unique_ptr<PhysicalSamples> samples(new PhysicalSamples);
  samples->request_ = request;
  dataset::DatasetSpecification& specification = samples->request_.specification;
  dataset::DatasetPart& part = samples->request_.part;
  if (specification.plan.kind == touch::Plan::Kind::kSphere)
    return absl::InvalidArgumentError(
        "plan.sphere makes no sense at this source: an arm cannot come from everywhere; faces and list would "
        "be right");
  TOUCHSTONE_ASSIGN_OR_RETURN(samples->request_.session, SessionName(request.session));
  TOUCHSTONE_RETURN_IF_ERROR(dataset::ValidateDataset(&specification, dataset::ImageOrigin::kPhotographed));
  // A touch takes seconds: whoever waits for a batch should not wait for hours.
  TOUCHSTONE_ASSIGN_OR_RETURN(part, request.part.Resolved(specification.samples, /*default_batch_size=*/1));
  if (specification.columns.image) {
    if (!device->has_camera())
      return absl::InvalidArgumentError("spec.columns has 'image': this source has no camera");
    TOUCHSTONE_RETURN_IF_ERROR(CheckPhotograph(specification.image));
  }

  samples->header_ = HeaderOf(specification, device->fingers(), device->spacing_m());
  for (const auto& object : specification.objects)
    samples->drawers_.push_back(std::make_unique<touch::PlanDrawer>(
        specification.plan, object, NominalModelOf(*device), specification.seed, specification.max_draws));
  samples->device_ = device;
  samples->rectify_ = std::move(rectify);
  samples->next_index_ = part.start_index;
  return samples;
}

absl::StatusOr<std::optional<dataset::DatasetBatch>> PhysicalSamples::Next(const MotionGuard& guard) {
  const dataset::DatasetPart& part = request_.part;
  if (next_index_ >= part.stop_index) return std::optional<dataset::DatasetBatch>();
  dataset::DatasetBatch batch = part.BatchAt(next_index_);
  const dataset::BatchColumns columns(header_.columns, request_.objects.size(), absl::MakeSpan(&batch, 1));
  for (uint32_t row = 0; row < batch.rows; ++row) {
    TOUCHSTONE_RETURN_IF_ERROR(guard());
    TOUCHSTONE_RETURN_IF_ERROR(MakeSample(row, guard, columns, &batch));
  }
  next_index_ += uint64_t{part.batch_size} * part.batch_stride;
  return std::optional<dataset::DatasetBatch>(std::move(batch));
}

absl::StatusOr<std::pair<TouchCommand, session::JournalTouch>> PhysicalSamples::MakeTouch(
    uint64_t index, const MotionGuard& guard, uint32_t* attempt) const {
  const dataset::DatasetSpecification& specification = request_.specification;
  const size_t which = index % request_.objects.size();
  touch::PlanDrawer& drawer = *drawers_[which];
  const touch::PoseGenerator& generator = drawer.generator();
  const uint64_t number = dataset::PlanNumber(index, request_.objects.size(), generator.Count() != 0);
  TouchCommand command;
  command.session = request_.session;
  command.object = request_.objects[which];
  command.bounds = specification.objects[which]->bounds();
  if (specification.plan.kind == touch::Plan::Kind::kFaces)
    command.repeat = number / (6 * specification.plan.faces.samples_per_face);
  touch::DrawCounts counts;
  for (uint32_t first = 0; first < specification.max_draws; first = *attempt + 1) {
    absl::StatusOr<touch::PlanDrawer::Drawn> drawn = drawer.Draw(number, first, &counts);
    if (!drawn.ok())
      return absl::Status(drawn.status().code(), absl::StrCat("object '", command.object, "', sample ", index,
                                                              ": ", drawn.status().message()));
    *attempt = drawn->attempt;
    command.id = absl::StrCat("dataset-", request_.key, "-", index, "-", *attempt);
    command.touch = std::move(drawn->touch);
    command.bytes = session::CommandBytes(command.touch);
    TOUCHSTONE_ASSIGN_OR_RETURN(session::JournalTouch touch, device_->Touch(command, guard));
    if (generator.Accepts(EveryFingerHit(touch))) return std::pair(command, std::move(touch));
  }
  return absl::FailedPreconditionError(
      absl::StrCat("sample ", index, ": no touch of ", specification.max_draws,
                   " draws had all fingers hit; raise max_draws or change the plan"));
}

absl::Status PhysicalSamples::MakeSample(uint32_t row, const MotionGuard& guard,
                                         const dataset::BatchColumns& columns,
                                         dataset::DatasetBatch* batch) const {
  const uint64_t index = batch->IndexOf(row);
  uint32_t attempt = 0;
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto made, MakeTouch(index, guard, &attempt));
  const auto& [command, touch] = made;
  const uint8_t accepted = 1;
  const touch::TouchPose pose = command.touch;
  columns.PutTouches({BatchOf(command, touch, index), {&row, 1}, {&accepted, 1}, {&pose, 1}, attempt});
  const dataset::DatasetSpecification& specification = request_.specification;
  if (!specification.columns.image) return absl::OkStatus();
  const image::Camera camera =
      image::CameraOfTouch(pose.target_m, pose.approach, pose.lateral, pose.standoff_m);
  const ViewCommand view{request_.session, command.object, command.bounds, ObjectFromCamera(camera), camera};
  TOUCHSTONE_ASSIGN_OR_RETURN(const Photograph photograph, device_->Photograph(view, guard));
  return columns.AppendPicture(ImageOf(photograph, *device_, rectify_, specification.image),
                               specification.image, batch);
}

}  // namespace touchstone::source
