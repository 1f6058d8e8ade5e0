// A renderer turns (surface, camera, options) into an image. Two exist: EGL (any OpenGL 3.3 driver, no
// display) and CPU (triangles drawn into a depth buffer, or Embree packets for fine meshes). Both compute the
// same picture: the same sampling (pixel centres), the same smooth normals (area-weighted vertex normals,
// split at creases sharper than kCreaseRad), the same lights; grey levels agree within 1/255 away from
// silhouettes. One renderer always gives the same bytes for the same request.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/geometry/surface/surface.h"
#include "server/image/image.h"

namespace touchstone::image {

class Renderer {
 public:
  virtual ~Renderer() = default;
  virtual std::string name() const = 0;         // "egl" or "cpu"
  virtual std::string description() const = 0;  // "EGL on llvmpipe (LLVM 15.0.6, 256 bits)", for people
  // Safe to call from several threads at once (an implementation may serialise). The surface's mesh data is
  // prepared at the first call and kept while the surface lives.
  virtual absl::StatusOr<Image> Render(const std::shared_ptr<const geometry::Surface>& surface,
                                       const Camera& camera, const ImageOptions& options) = 0;
};

enum class RendererKind { kAuto, kEgl, kCpu };

struct RendererOptions {
  RendererKind kind = RendererKind::kAuto;  // kAuto: the faster one, timed once on a small scene
  int egl_device = -1;  // index into ListEglDevices(); -1: the first that renders, GPU first
};

// An error says why no renderer of that kind can be had (for instance a build without EGL).
absl::StatusOr<std::shared_ptr<Renderer>> CreateRenderer(const RendererOptions& options);

absl::StatusOr<std::shared_ptr<Renderer>> CreateCpuRenderer();  // renderer_cpu.cpp
absl::StatusOr<std::shared_ptr<Renderer>> CreateEglRenderer(
    int device);  // renderer_egl.cpp or renderer_absent.cpp

// One EGL device (or the surfaceless default platform) for `doctor`.
struct EglDevice {
  int index = 0;
  std::string vendor;
  std::string name;      // GL_RENDERER, or the driver's file
  bool renders = false;  // an OpenGL 3.3 core context could be made
  bool software = false;
  std::string problem;  // in words, if it does not render
};
std::vector<EglDevice> ListEglDevices();

// Checks sizes and camera vectors; the error names field, value and what would be right.
absl::Status ValidateImageRequest(const Camera& camera, const ImageOptions& options);

}  // namespace touchstone::image
