#include "server/base/status.h"
#include "server/base/threads/thread_pool.h"
#include "server/dataset/stream.h"
#include "server/image/photograph/photo_image.h"

namespace touchstone::dataset {

BatchMaker::BatchMaker(std::shared_ptr<const DatasetSpecification> specification)
    : specification_(std::move(specification)),
      columns_(ColumnsOf(*specification_)),
      sampler_(*specification_) {}

absl::Status BatchMaker::Make(absl::Span<DatasetBatch> batches, const std::atomic<bool>& cancelled,
                              TouchSampler::Workspace* workspace) const {
  if (batches.empty()) return absl::OkStatus();
  std::vector<uint64_t> indices;
  indices.reserve(batches.size() * batches[0].rows);
  for (const DatasetBatch& batch : batches)
    for (uint32_t row = 0; row < batch.rows; ++row) indices.push_back(batch.IndexOf(row));

  const BatchColumns columns(columns_, specification_->objects.size(), batches);
  std::vector<touch::TouchPose> poses(specification_->columns.image ? indices.size() : 0);
  TOUCHSTONE_RETURN_IF_ERROR(
      sampler_.Sample(indices, cancelled, workspace, [&](const TouchSampler::Block& block) {
        columns.PutTouches(block);
        if (!poses.empty())
          for (int touch = 0; touch < block.batch.size(); ++touch)
            if (block.accepted[touch]) poses[block.slots[touch]] = block.Pose(touch);
      }));
  if (specification_->columns.image) return MakeImages(batches, columns, poses, cancelled);
  return absl::OkStatus();
}

absl::Status BatchMaker::MakeImages(absl::Span<DatasetBatch> batches, const BatchColumns& columns,
                                    absl::Span<const touch::TouchPose> poses,
                                    const std::atomic<bool>& cancelled) const {
  const DatasetImage& image = specification_->image;
  image::PhotoWorkspace workspace;
  size_t slot = 0;
  for (DatasetBatch& batch : batches) {
    for (uint32_t row = 0; row < batch.rows; ++row, ++slot) {
      if (cancelled.load(std::memory_order_relaxed)) return absl::CancelledError("the stream was cancelled");
      ThreadPool::GiveWay();
      const touch::TouchPose& pose = poses[slot];
      image::Camera camera =
          image::CameraOfTouch(pose.target_m, pose.approach, pose.lateral, pose.standoff_m);
      camera.vertical_fov_rad = image.vertical_fov_rad;
      const uint64_t index = batch.IndexOf(row);
      const auto& object = specification_->objects[index % specification_->objects.size()];
      const image::PhotoNumber number{specification_->seed, index};
      TOUCHSTONE_ASSIGN_OR_RETURN(const std::shared_ptr<const model::Model> model, sampler_.ModelOf(index));
      const bool photographs = image::ChangesPhotographs(*model);
      TOUCHSTONE_ASSIGN_OR_RETURN(
          const image::Image picture,
          photographs ? image::TakePhotograph(model, object, camera, image.options, number, &workspace)
                      : image.renderer->Render(object, camera, image.options));
      TOUCHSTONE_RETURN_IF_ERROR(columns.AppendPicture(picture, image, &batch));
    }
  }
  return absl::OkStatus();
}

}  // namespace touchstone::dataset
