#include "server/source/source.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/base/text/over_limit.h"
#include "server/touch/plan_drawer.h"
#include "server/touch/touch_notes.h"

namespace touchstone::source {

namespace {

// How many touches a request asks for, of a plan with so many (0: no end).
absl::StatusOr<uint64_t> CountOf(const PlanRequest& request, uint64_t available, uint64_t limit) {
  uint64_t count = request.count;
  if (available != 0) {
    if (request.first_index > available)
      return absl::OutOfRangeError(
          absl::StrCat("first_index = ", request.first_index, ": the plan has ", available, " touches"));
    const uint64_t left = available - request.first_index;
    count = count == 0 ? left : std::min(count, left);
  }
  if (count > limit)
    return OverLimit("a plan is asked for in parts by first_index: count =", count, "max_touches_per_request",
                     limit);
  return count;
}

}  // namespace

absl::StatusOr<ExpandedPlan> Source::ExpandPlan(const PlanRequest& request, const MotionGuard& guard) const {
  const uint64_t limit = limits_.max_touches_per_request;
  const std::shared_ptr<const model::Model> model = request.model != nullptr ? request.model : OwnModel();
  ExpandedPlan plan;
  std::shared_ptr<const geometry::Surface> surface;  // of a list, which may do without, null
  if (request.plan.kind == touch::Plan::Kind::kList) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const uint64_t count, CountOf(request, request.plan.list.size(), limit));
    const auto first = request.plan.list.begin() + request.first_index;
    plan.touches.assign(first, first + count);
    if (const absl::StatusOr<const ServedObject*> object = objects_.Find(request.object, "object");
        object.ok())
      surface = (*object)->surface;
  } else {
    TOUCHSTONE_ASSIGN_OR_RETURN(const ServedObject* object, objects_.Find(request.object, "object"));
    surface = object->surface;
    touch::PlanDrawer drawer(request.plan, surface, model, request.seed, request.max_draws);
    TOUCHSTONE_ASSIGN_OR_RETURN(const uint64_t count, CountOf(request, drawer.generator().Count(), limit));
    for (uint64_t k = 0; k < count; ++k) {
      TOUCHSTONE_RETURN_IF_ERROR(guard());
      const uint64_t number = request.first_index + k;
      absl::StatusOr<touch::PlanDrawer::Drawn> drawn =
          drawer.Draw(number, 0, &plan.draws, [&] { return !guard().ok(); });
      if (!drawn.ok())
        return absl::Status(drawn.status().code(), absl::StrCat("object '", request.object, "', touch ",
                                                                number, ": ", drawn.status().message()));
      plan.touches.push_back(std::move(drawn->touch));
    }
  }
  if (surface != nullptr)
    plan.notes = touch::NotesOnTouches(*surface, *model, plan.touches, request.first_index);
  return plan;
}

absl::StatusOr<TouchResults> Source::Touch(const TouchRequest& request, const MotionGuard& guard) {
  TOUCHSTONE_RETURN_IF_ERROR(guard());
  TOUCHSTONE_ASSIGN_OR_RETURN(const ServedObject* object, objects_.Find(request.object, "object"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckTouchCount(request.touches.size(), limits_));
  TOUCHSTONE_RETURN_IF_ERROR(CheckTouchIds(request.ids, request.touches.size()));
  TOUCHSTONE_ASSIGN_OR_RETURN(TouchResults results, MakeTouches(request, *object, guard));
  const std::shared_ptr<const model::Model> model = request.model != nullptr ? request.model : OwnModel();
  results.notes = touch::NotesOnTouches(*object->surface, *model, request.touches, request.first_index);
  return results;
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
  header.columns = dataset::ColumnsOf(specification.columns, specification.image, fingers,
                                      dataset::OpenValuesOf(specification));
  return header;
}

absl::StatusOr<std::unique_ptr<SampleStream>> Source::Stream(const SampleRequest& request) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckBatchSize(request.part.batch_size, limits_));
  TOUCHSTONE_RETURN_IF_ERROR(CheckIndices(request.part.indices.size(), limits_));
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
