#include "server/source/virtual_source.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/image/photograph/photo_image.h"
#include "server/touch/batch_row.h"
#include "server/touch/simulate.h"

namespace touchstone::source {
namespace {

constexpr size_t kTouchBlock = 1024;

// How many touches from `begin` on go through the simulation together: those of different strokes never share a batch.
size_t BlockSize(const std::vector<touch::CommandedTouch>& touches, size_t begin) {
  size_t count = 1;
  while (count < kTouchBlock && begin + count < touches.size() &&
         touches[begin + count].stroke_m == touches[begin].stroke_m)
    ++count;
  return count;
}

absl::Status FillBlock(const TouchRequest& request, const ServedObject& object, size_t begin, int count,
                       const touch::TouchSimulator& simulator, effects::TouchBatch* batch) {
  simulator.Prepare(count, batch);
  batch->surface = object.surface;
  batch->seed = request.seed;
  batch->stroke_m = request.touches[begin].stroke_m;
  for (int k = 0; k < count; ++k) {
    const touch::CommandedTouch& touch = request.touches[begin + k];
    touch::SetTouch(touch, request.first_index + begin + k, k, batch);
    const touch::CommandedTouch* before = begin + k > 0               ? &request.touches[begin + k - 1]
                                          : !request.previous.empty() ? &request.previous.back().touch
                                                                      : nullptr;
    if (before != nullptr)
      batch->pause_s[k] = touch::PauseBetween(before->session_time_s, touch.session_time_s);
    if (!simulator.needed_covariates().empty())
      TOUCHSTONE_RETURN_IF_ERROR(touch::SetCovariates(simulator.needed_covariates(), touch,
                                                      absl::StrCat("touches[", begin + k, "]"), k, batch));
  }
  return absl::OkStatus();
}

void AppendRows(const effects::TouchBatch& batch, TouchResults* results) {
  for (int touch = 0; touch < batch.size(); ++touch)
    for (int finger = 0; finger < batch.fingers(); ++finger) {
      const int k = batch.At(finger, touch);
      results->contact_time_s.push_back(batch.reported_time_s[k]);
      results->travel_m.push_back(batch.travel_m[k]);
      results->contact_m.push_back(batch.contact_m[k]);
      results->normal.push_back(batch.normal[k]);
    }
}

class VirtualSamples final : public SampleStream {
 public:
  VirtualSamples(SampleHeader header, std::unique_ptr<dataset::DatasetStream> stream)
      : header_(std::move(header)), stream_(std::move(stream)) {}

  const SampleHeader& header() const override { return header_; }
  absl::StatusOr<std::optional<dataset::DatasetBatch>> Next(const MotionGuard& guard) override {
    absl::Status ended = guard();
    if (!ended.ok()) return ended;
    auto batch = stream_->Next([&] { return !(ended = guard()).ok(); });
    if (!ended.ok()) return ended;
    return batch;
  }

 private:
  const SampleHeader header_;
  const std::unique_ptr<dataset::DatasetStream> stream_;
};

}  // namespace

absl::StatusOr<std::shared_ptr<image::Renderer>> VirtualSource::RendererFor(image::RendererKind kind) const {
  std::lock_guard<std::mutex> lock(renderer_mutex_);
  if (kind == image::RendererKind::kAuto) kind = renderer_options_.kind;
  std::shared_ptr<image::Renderer>& renderer = renderers_[kind];
  if (renderer != nullptr) return renderer;
  image::RendererOptions options = renderer_options_;
  options.kind = kind;
  TOUCHSTONE_ASSIGN_OR_RETURN(renderer, image::CreateRenderer(options));
  return renderer;
}

SourceInfo VirtualSource::Describe() const {
  SourceInfo info;
  info.kind = SourceKind::kVirtual;
  info.plans = {touch::Plan::Kind::kSphere, touch::Plan::Kind::kFaces, touch::Plan::Kind::kList};
  info.default_model = default_model_;
  const auto renderer = RendererFor(image::RendererKind::kAuto);
  info.makes_images = renderer.ok();
  if (renderer.ok()) info.renderer = (*renderer)->name();
  info.renderer_description =
      renderer.ok() ? (*renderer)->description() : absl::StrCat("none: ", renderer.status().message());
  info.max_fingers = model::kMaxFingers;
  return info;
}

absl::StatusOr<TouchResults> VirtualSource::MakeTouches(const TouchRequest& request,
                                                        const ServedObject& object,
                                                        const MotionGuard& guard) {
  const std::shared_ptr<const model::Model> model = request.model != nullptr ? request.model : default_model_;
  const touch::TouchSimulator simulator(model);
  effects::TouchBatch batch;
  touch::TouchWorkspace workspace;
  TouchResults results;
  results.fingers = model->fingers;
  results.model = model;
  std::vector<double> press_m(model->fingers, 0.0);  // of the touch before the block
  const ServedObject* before = nullptr;              // the object of the touch before
  for (const PreviousTouch& previous : request.previous) {
    TOUCHSTONE_ASSIGN_OR_RETURN(before, objects().Find(previous.object, "previous.object"));
  }
  if (before != nullptr && simulator.needs_previous_press()) {
    TouchRequest alone;
    alone.touches = {request.previous.back().touch};
    alone.previous.assign(request.previous.begin(), request.previous.end() - 1);
    TOUCHSTONE_RETURN_IF_ERROR(FillBlock(alone, *before, 0, 1, simulator, &batch));
    TOUCHSTONE_RETURN_IF_ERROR(simulator.RunToMotion(&batch, &workspace));
    press_m = batch.press_m;
  }
  for (size_t begin = 0; begin < request.touches.size();) {
    TOUCHSTONE_RETURN_IF_ERROR(guard());
    const int count = static_cast<int>(BlockSize(request.touches, begin));
    TOUCHSTONE_RETURN_IF_ERROR(FillBlock(request, object, begin, count, simulator, &batch));
    if (simulator.needs_previous_press()) {
      TOUCHSTONE_RETURN_IF_ERROR(simulator.RunToMotion(&batch, &workspace));
      std::vector<double> previous_press_m(batch.press_m.size());
      for (int k = 0; k < count; ++k)
        for (int finger = 0; finger < model->fingers; ++finger)
          previous_press_m[batch.At(finger, k)] =
              k > 0 ? batch.press_m[batch.At(finger, k - 1)] : press_m[finger];
      for (int finger = 0; finger < model->fingers; ++finger)
        press_m[finger] = batch.press_m[batch.At(finger, count - 1)];
      TOUCHSTONE_RETURN_IF_ERROR(FillBlock(request, object, begin, count, simulator, &batch));
      batch.previous_press_m = std::move(previous_press_m);
    }
    TOUCHSTONE_RETURN_IF_ERROR(simulator.Run(&batch, &workspace));
    AppendRows(batch, &results);
    begin += count;
  }
  return results;
}

absl::Status VirtualSource::MakePictures(const CaptureRequest& request, const ServedObject& object,
                                         const MotionGuard& guard, const TakePicture& take) {
  const std::shared_ptr<const model::Model> model = request.model != nullptr ? request.model : default_model_;
  if (image::ChangesPhotographs(*model)) {
    image::PhotoWorkspace workspace;
    for (size_t k = 0; k < request.cameras.size(); ++k) {
      TOUCHSTONE_RETURN_IF_ERROR(guard());
      TOUCHSTONE_ASSIGN_OR_RETURN(
          const image::Image picture,
          image::TakePhotograph(model, object.surface, request.cameras[k], request.image.options,
                                {request.seed, request.first_index + k}, &workspace));
      TOUCHSTONE_RETURN_IF_ERROR(take(picture, nullptr));
    }
    return absl::OkStatus();
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::shared_ptr<image::Renderer> renderer,
                              RendererFor(request.image.renderer_kind));
  for (const image::Camera& camera : request.cameras) {
    TOUCHSTONE_RETURN_IF_ERROR(guard());
    TOUCHSTONE_ASSIGN_OR_RETURN(const image::Image picture,
                                renderer->Render(object.surface, camera, request.image.options));
    TOUCHSTONE_RETURN_IF_ERROR(take(picture, nullptr));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<SampleStream>> VirtualSource::MakeStream(const SampleRequest& request) {
  auto specification = std::make_shared<dataset::DatasetSpecification>(request.specification);
  if (specification->model == nullptr) specification->model = default_model_;
  if (specification->columns.image) {
    TOUCHSTONE_ASSIGN_OR_RETURN(specification->image.renderer,
                                RendererFor(specification->image.renderer_kind));
  }
  TOUCHSTONE_RETURN_IF_ERROR(dataset::ValidateDataset(specification.get()));
  SampleHeader header =
      HeaderOf(*specification, specification->model->fingers, specification->model->spacing_m);
  header.model = specification->model;
  if (specification->columns.image) header.renderer = specification->image.renderer->name();
  TOUCHSTONE_ASSIGN_OR_RETURN(
      std::unique_ptr<dataset::DatasetStream> stream,
      dataset::DatasetStream::Create(std::move(specification), request.part, pool_, request.share));
  return std::make_unique<VirtualSamples>(std::move(header), std::move(stream));
}

}  // namespace touchstone::source
