// Chooses a renderer: by name, or by timing both once.
#include "server/image/renderers/renderer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "server/base/status.h"
#include "server/base/units.h"

namespace touchstone::image {
namespace {

// A wavy sphere of about 10,000 triangles: as many as an object of a usual data set has in sight.
absl::StatusOr<std::shared_ptr<const geometry::Surface>> TimingSurface() {
  constexpr uint32_t kRings = 72, kSectors = 72;
  geometry::TriangleMesh mesh;
  for (uint32_t ring = 0; ring <= kRings; ++ring) {
    for (uint32_t sector = 0; sector < kSectors; ++sector) {
      const double latitude = kPi * (ring / double{kRings} - 0.5), longitude = 2 * kPi * sector / kSectors;
      // Exactly 0 at the poles, so that their vertices coincide and the sphere is closed.
      const double cos_latitude = ring == 0 || ring == kRings ? 0.0 : std::cos(latitude);
      const double radius_m = 0.07 + 0.01 * std::cos(4 * longitude) * cos_latitude;
      mesh.vertices_m.emplace_back(static_cast<float>(radius_m * cos_latitude * std::cos(longitude)),
                                   static_cast<float>(radius_m * cos_latitude * std::sin(longitude)),
                                   static_cast<float>(radius_m * std::sin(latitude)));
    }
  }
  for (uint32_t ring = 0; ring < kRings; ++ring) {
    for (uint32_t sector = 0; sector < kSectors; ++sector) {
      const uint32_t next = (sector + 1) % kSectors;
      const uint32_t a = ring * kSectors + sector, b = ring * kSectors + next;
      const uint32_t c = a + kSectors, d = b + kSectors;
      if (ring > 0) mesh.triangles.push_back({a, b, d});
      if (ring + 1 < kRings) mesh.triangles.push_back({a, d, c});
    }
  }
  return geometry::Surface::Create("timing", std::move(mesh));
}

// Images per second on one thread: the best of several, after two that warm up.
absl::StatusOr<double> ImagesPerSecond(Renderer& renderer,
                                       const std::shared_ptr<const geometry::Surface>& surface) {
  Camera camera;
  camera.eye_m = {0.25, 0.12, 0.08};
  const ImageOptions options;
  double shortest_s = 1e9;
  for (int i = 0; i < 8; ++i) {
    const auto start = std::chrono::steady_clock::now();
    TOUCHSTONE_RETURN_IF_ERROR(renderer.Render(surface, camera, options).status());
    const std::chrono::duration<double> taken_s = std::chrono::steady_clock::now() - start;
    if (i >= 2) shortest_s = std::min(shortest_s, taken_s.count());
  }
  return 1.0 / shortest_s;
}

// A renderer together with the reason why it was chosen.
class ChosenRenderer final : public Renderer {
 public:
  ChosenRenderer(std::shared_ptr<Renderer> renderer, std::string reason)
      : renderer_(std::move(renderer)), reason_(std::move(reason)) {}
  std::string name() const override { return renderer_->name(); }
  std::string description() const override { return absl::StrCat(renderer_->description(), "; ", reason_); }
  absl::StatusOr<Image> Render(const std::shared_ptr<const geometry::Surface>& surface, const Camera& camera,
                               const ImageOptions& options) override {
    return renderer_->Render(surface, camera, options);
  }

 private:
  std::shared_ptr<Renderer> renderer_;
  std::string reason_;
};

absl::StatusOr<std::shared_ptr<Renderer>> ChooseFaster(int egl_device) {
  TOUCHSTONE_ASSIGN_OR_RETURN(std::shared_ptr<Renderer> cpu, CreateCpuRenderer());
  const auto choose = [](std::shared_ptr<Renderer> renderer, std::string reason) {
    return std::shared_ptr<Renderer>(
        std::make_shared<ChosenRenderer>(std::move(renderer), std::move(reason)));
  };
  absl::StatusOr<std::shared_ptr<Renderer>> egl = CreateEglRenderer(egl_device);
  if (!egl.ok())
    return choose(cpu, absl::StrCat("chosen since EGL is not to be had: ", egl.status().message()));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::shared_ptr<const geometry::Surface> surface, TimingSurface());
  const absl::StatusOr<double> egl_speed = ImagesPerSecond(**egl, surface);
  if (!egl_speed.ok())
    return choose(cpu, absl::StrCat("chosen since EGL failed to draw: ", egl_speed.status().message()));
  TOUCHSTONE_ASSIGN_OR_RETURN(const double cpu_speed, ImagesPerSecond(*cpu, surface));
  if (*egl_speed > cpu_speed) {
    return choose(*egl, absl::StrFormat("chosen as faster than the cpu renderer: %.0f against %.0f images/s",
                                        *egl_speed, cpu_speed));
  }
  return choose(cpu, absl::StrFormat("chosen as faster than %s: %.0f against %.0f images/s",
                                     (*egl)->description(), cpu_speed, *egl_speed));
}

}  // namespace

absl::StatusOr<std::shared_ptr<Renderer>> CreateRenderer(const RendererOptions& options) {
  switch (options.kind) {
    case RendererKind::kCpu:
      return CreateCpuRenderer();
    case RendererKind::kEgl:
      return CreateEglRenderer(options.egl_device);
    case RendererKind::kAuto:
      return ChooseFaster(options.egl_device);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("renderer kind is ", static_cast<int>(options.kind), "; must be auto, egl or cpu"));
}

}  // namespace touchstone::image
