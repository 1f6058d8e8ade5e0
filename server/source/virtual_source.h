// The virtual source: a model simulates touches, a renderer takes the photographs.
#pragma once

#include <map>
#include <memory>
#include <mutex>

#include "server/base/threads/thread_pool.h"
#include "server/source/source.h"

namespace touchstone::source {

class VirtualSource final : public Source {
 public:
  // `objects` and `pool`, which datasets are computed with, must outlive the source.
  VirtualSource(const ObjectStore* objects, const SourceLimits& limits,
                std::shared_ptr<const model::Model> default_model, const image::RendererOptions& renderer,
                ThreadPool* pool)
      : Source(objects, limits),
        default_model_(std::move(default_model)),
        renderer_options_(renderer),
        pool_(pool) {}

  SourceInfo Describe() const override;

 protected:
  std::shared_ptr<const model::Model> OwnModel() const override { return default_model_; }
  absl::StatusOr<TouchResults> MakeTouches(const TouchRequest& request, const ServedObject& object,
                                           const MotionGuard& guard) override;
  absl::Status MakePictures(const CaptureRequest& request, const ServedObject& object,
                            const MotionGuard& guard, const TakePicture& take) override;
  absl::StatusOr<std::unique_ptr<SampleStream>> MakeStream(const SampleRequest& request) override;

 private:
  // Made at the first use, so that a source is ready before a driver is.
  absl::StatusOr<std::shared_ptr<image::Renderer>> RendererFor(image::RendererKind kind) const;

  const std::shared_ptr<const model::Model> default_model_;
  const image::RendererOptions renderer_options_;
  ThreadPool* const pool_;
  mutable std::mutex renderer_mutex_;
  mutable std::map<image::RendererKind, std::shared_ptr<image::Renderer>> renderers_;
};

}  // namespace touchstone::source
