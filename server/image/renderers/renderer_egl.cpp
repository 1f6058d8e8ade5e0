// The EGL renderer: OpenGL 3.3 on any device that EGL finds, no window system, no display variable.
//
// The context belongs to a thread of the renderer's own for all its life: callers hand it their requests and
// wait, so whatever contexts they have themselves stay untouched, and drivers never see a context change
// threads.
//
// There is one context, for two reasons: llvmpipe has one rasteriser per process, so that further contexts wait
// for it (measured: two drew no more images per second than one), and a GPU has one queue.
#include <condition_variable>
#include <deque>
#include <future>
#include <mutex>
#include <thread>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/string_view.h>

#include "server/base/status.h"
#include "server/image/renderers/egl_device.h"
#include "server/image/renderers/gl_rasterizer.h"
#include "server/image/renderers/renderer.h"
#include "server/image/scene/shading_mesh.h"

namespace touchstone::image {
namespace {

class EglRenderer final : public Renderer {
 public:
  static absl::StatusOr<std::shared_ptr<Renderer>> Create(int device) {
    auto renderer = std::make_shared<EglRenderer>();
    std::promise<absl::Status> promise;
    std::future<absl::Status> started = promise.get_future();
    renderer->thread_ = std::thread(&EglRenderer::Run, renderer.get(), device, std::move(promise));
    TOUCHSTONE_RETURN_IF_ERROR(started.get());
    return std::shared_ptr<Renderer>(std::move(renderer));
  }

  ~EglRenderer() override {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    wake_.notify_all();
    thread_.join();
  }

  std::string name() const override { return "egl"; }
  std::string description() const override { return absl::StrCat("EGL on ", gl_renderer_); }

  absl::StatusOr<Image> Render(const std::shared_ptr<const geometry::Surface>& surface, const Camera& camera,
                               const ImageOptions& options) override {
    TOUCHSTONE_RETURN_IF_ERROR(ValidateImageRequest(camera, options));
    Job job{surface, meshes_.Get(surface), camera, options, {}};
    std::future<absl::StatusOr<Image>> image = job.image.get_future();
    {
      std::lock_guard<std::mutex> lock(mutex_);
      jobs_.push_back(&job);
    }
    wake_.notify_one();
    return image.get();
  }

 private:
  struct Job {
    std::shared_ptr<const geometry::Surface> surface;
    std::shared_ptr<const ShadingMesh> mesh;
    const Camera& camera;
    const ImageOptions& options;
    std::promise<absl::StatusOr<Image>> image;
  };

  // What draws, with the context that it needs; used and destroyed on the context's thread.
  struct Drawing {
    std::unique_ptr<EglContext> context;
    std::unique_ptr<GlRasterizer> rasterizer;  // goes first
  };

  static absl::StatusOr<Drawing> MakeDrawing(int device) {
    Drawing drawing;
    TOUCHSTONE_ASSIGN_OR_RETURN(drawing.context, EglContext::Create(EglDisplays()[device]));
    TOUCHSTONE_ASSIGN_OR_RETURN(drawing.rasterizer, GlRasterizer::Create());
    return drawing;
  }

  // The life of the context's thread.
  void Run(int device, std::promise<absl::Status> started) {
    absl::StatusOr<Drawing> drawing = MakeDrawing(device);
    if (!drawing.ok()) return started.set_value(drawing.status());
    gl_renderer_ = drawing->rasterizer->gl_renderer();
    started.set_value(absl::OkStatus());

    while (Job* job = NextJob()) {
      // Taken out first: as soon as the value is set, the caller may be gone with his job.
      std::promise<absl::StatusOr<Image>> image = std::move(job->image);
      image.set_value(Draw(device, *job, &drawing));
    }
  }

  // A device that was lost may be there again: then the picture is drawn anew, by a new context on the same device, so
  // that its bytes are what they would have been. Never by another one. UNAVAILABLE where that cannot be.
  absl::StatusOr<Image> Draw(int device, const Job& job, absl::StatusOr<Drawing>* drawing) {
    for (int attempt = 0; attempt < 2; ++attempt) {
      if (!drawing->ok()) {
        *drawing = MakeDrawing(device);
        if (drawing->ok() && (*drawing)->rasterizer->gl_renderer() != gl_renderer_)
          *drawing = absl::UnavailableError(
              absl::StrCat("it draws as ", (*drawing)->rasterizer->gl_renderer(), " now"));
        if (!drawing->ok()) return Gone(drawing->status().message());
      }
      absl::StatusOr<Image> image =
          (*drawing)->rasterizer->Draw(job.surface, *job.mesh, job.camera, job.options);
      if (!(*drawing)->context->Lost()) return image;
      *drawing = absl::UnavailableError("it was reset while it drew");
    }
    return Gone(drawing->status().message());
  }

  absl::Status Gone(absl::string_view why) const {
    return absl::UnavailableError(
        absl::StrCat("the graphics device was lost (EGL on ", gl_renderer_, "): ", why,
                     ". The next picture tries it again; a start with the renderer cpu does without it"));
  }

  // Null when the renderer goes.
  Job* NextJob() {
    std::unique_lock<std::mutex> lock(mutex_);
    wake_.wait(lock, [this] { return stopping_ || !jobs_.empty(); });
    if (jobs_.empty()) return nullptr;
    Job* job = jobs_.front();
    jobs_.pop_front();
    return job;
  }

  ShadingMeshCache meshes_;
  std::string gl_renderer_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<Job*> jobs_;
  bool stopping_ = false;
  std::thread thread_;
};

std::string Describe(const EglDevice& device) {
  return absl::StrFormat("%d (%s: %s)", device.index, device.name.empty() ? "unnamed" : device.name,
                         device.renders ? "renders" : device.problem);
}

// The first device that renders, hardware before software; or the one asked for.
absl::StatusOr<EglDevice> ChooseDevice(int wanted) {
  const std::vector<EglDevice> devices = ListEglDevices();
  std::string all;
  for (const EglDevice& device : devices) absl::StrAppend(&all, all.empty() ? "" : ", ", Describe(device));
  if (wanted >= static_cast<int>(devices.size()) || wanted < -1) {
    return absl::InvalidArgumentError(
        absl::StrFormat("EGL device is %d; must be -1 (choose one) or one of: %s", wanted, all));
  }
  if (wanted >= 0) {
    if (devices[wanted].renders) return devices[wanted];
    return absl::UnavailableError(absl::StrFormat("EGL device %d does not render: %s; all devices: %s",
                                                  wanted, devices[wanted].problem, all));
  }
  for (const bool software : {false, true})
    for (const EglDevice& device : devices)
      if (device.renders && device.software == software) return device;
  return absl::UnavailableError(absl::StrCat("no EGL device renders: ", all));
}

}  // namespace

absl::StatusOr<std::shared_ptr<Renderer>> CreateEglRenderer(int device) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const EglDevice chosen, ChooseDevice(device));
  return EglRenderer::Create(chosen.index);
}

}  // namespace touchstone::image
