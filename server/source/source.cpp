#include "server/source/source.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

#include "server/base/status.h"

namespace touchstone::source {

absl::StatusOr<std::vector<touch::CommandedTouch>> Source::ExpandPlan(const PlanRequest& request) const {
  geometry::Bounds bounds;
  if (request.plan.kind != touch::Plan::Kind::kList) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const ServedObject* object, objects_.Find(request.object, "object"));
    bounds = object->surface->bounds();
  }
  const auto generator = touch::MakePoseGenerator(request.plan, bounds, request.seed);
  uint64_t count = request.count;
  if (generator->Count() != 0) {
    if (request.first_index > generator->Count())
      return absl::OutOfRangeError(absl::StrCat("first_index = ", request.first_index, ": the plan has ",
                                                generator->Count(), " touches"));
    const uint64_t left = generator->Count() - request.first_index;
    count = count == 0 ? left : std::min(count, left);
  }
  const uint64_t limit = limits_.max_touches_per_request;
  if (count > limit)
    return absl::InvalidArgumentError(absl::StrCat("count = ", count, ": at most ", limit,
                                                   " touches per request; ask in parts by first_index"));
  std::vector<touch::CommandedTouch> touches;
  for (uint64_t k = 0; k < count; ++k)
    touches.push_back(touch::TouchOfPlan(request.plan, *generator, request.first_index + k, 0));
  return touches;
}

absl::StatusOr<TouchResults> Source::Touch(const TouchRequest& request, const MotionGuard& guard) {
  TOUCHSTONE_RETURN_IF_ERROR(guard());
  TOUCHSTONE_ASSIGN_OR_RETURN(const ServedObject* object, objects_.Find(request.object, "object"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckTouchCount(request.touches.size(), limits_));
  TOUCHSTONE_RETURN_IF_ERROR(CheckTouchIds(request.ids, request.touches.size()));
  return MakeTouches(request, *object, guard);
}

absl::StatusOr<CaptureResults> Source::Capture(const CaptureRequest& request, const MotionGuard& guard) {
  TOUCHSTONE_RETURN_IF_ERROR(guard());
  TOUCHSTONE_ASSIGN_OR_RETURN(const ServedObject* object, objects_.Find(request.object, "object"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckViews(request.cameras.size(), request.image, limits_));
  for (size_t k = 0; k < request.cameras.size(); ++k)
    if (const absl::Status status = image::ValidateImageRequest(request.cameras[k], request.image.options);
        !status.ok())
      return absl::Status(status.code(), absl::StrCat("views[", k, "]: ", status.message()));
  dataset::ColumnChoice images_only;
  images_only.image = true;
  CaptureResults results;
  results.columns = dataset::ColumnsOf(images_only, request.image, 0);  // the same columns as in a dataset
  results.batch.data.resize(results.columns.size());
  results.batch.offsets.resize(results.columns.size());
  const auto take = [&](const image::Image& taken, const PhotographPose* pose) -> absl::Status {
    TOUCHSTONE_ASSIGN_OR_RETURN(const image::Image picture, dataset::AsAsked(taken, request.image));
    for (size_t k = 0; k < results.columns.size(); ++k)
      TOUCHSTONE_RETURN_IF_ERROR(dataset::AppendPicture(picture, request.image, results.columns[k].name,
                                                        &results.batch.data[k], &results.batch.offsets[k]));
    ++results.batch.rows;
    if (pose != nullptr) results.photographs.push_back(*pose);
    return absl::OkStatus();
  };
  TOUCHSTONE_RETURN_IF_ERROR(MakePictures(request, *object, guard, take));
  return results;
}

SampleHeader HeaderOf(const dataset::DatasetSpecification& specification, int fingers, double spacing_m) {
  SampleHeader header;
  header.samples = specification.samples;
  for (const auto& object : specification.objects) header.mesh_hashes.push_back(object->hash());
  header.fingers = fingers;
  header.spacing_m = spacing_m;
  header.columns = dataset::ColumnsOf(specification.columns, specification.image, fingers);
  return header;
}

absl::StatusOr<std::unique_ptr<SampleStream>> Source::Stream(const SampleRequest& request) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckBatchSize(request.part.batch_size, limits_));
  SampleRequest resolved = request;
  resolved.specification.objects.clear();
  for (size_t k = 0; k < request.objects.size(); ++k) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const ServedObject* object,
                                objects_.Find(request.objects[k], absl::StrCat("spec.objects[", k, "]")));
    resolved.specification.objects.push_back(object->surface);
  }
  return MakeStream(resolved);
}

}  // namespace touchstone::source
