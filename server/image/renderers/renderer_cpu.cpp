// The CPU renderer: which triangle is seen in each pixel, then its shading.
//
// Coarse meshes are drawn triangle by triangle, fine ones and views that need clipping are cast with Embree's
// ray packets. Neither says more than which triangle is seen; where on it is computed from the triangle, so
// grey levels and depths are the same either way. Which way is taken depends on the request and the mesh
// alone.
//
// One call runs on the calling thread; callers draw several images at once for more speed.
#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/image/renderers/cpu_frame.h"
#include "server/image/renderers/renderer.h"
#include "server/image/scene/shading_mesh.h"

namespace touchstone::image {
namespace {

class CpuRenderer final : public Renderer {
 public:
  explicit CpuRenderer(const CpuKernels& kernels) : kernels_(kernels) {}

  std::string name() const override { return "cpu"; }
  std::string description() const override {
    return absl::StrCat("CPU: coarse meshes by triangles (", kernels_.name, "), fine ones by rays (",
                        geometry::EmbreeDescription(), ")");
  }

  absl::StatusOr<Image> Render(const std::shared_ptr<const geometry::Surface>& surface, const Camera& camera,
                               const ImageOptions& options) override {
    TOUCHSTONE_RETURN_IF_ERROR(ValidateImageRequest(camera, options));
    const std::shared_ptr<const ShadingMesh> mesh = meshes_.Get(surface);
    const CpuFrame frame = MakeCpuFrame(*surface, *mesh, camera, options);

    Image image;
    image.width = options.width;
    image.height = options.height;
    image.channels = options.format == PixelFormat::kRgb ? 3 : 1;
    const size_t pixels = static_cast<size_t>(options.width) * options.height;
    image.pixels.assign(pixels * image.channels, frame.lighting.background);
    if (options.depth) image.depth_m.assign(pixels, 0.0f);
    if (options.mask) image.mask.assign(pixels, 0);
    if (frame.box.first_column >= frame.box.last_column || frame.box.first_row >= frame.box.last_row)
      return image;

    Visibility visibility(frame.box);
    if (IsCoarse(frame) && CanDrawTriangles(frame)) {
      DrawTriangles(frame, kernels_, &visibility);
    } else {
      CastPixels(frame, &visibility);
    }
    ShadeVisible(frame, kernels_, visibility, &image);
    return image;
  }

 private:
  const CpuKernels& kernels_;
  ShadingMeshCache meshes_;
};

}  // namespace

std::shared_ptr<Renderer> CreateCpuRendererOf(const CpuKernels& kernels) {
  return std::make_shared<CpuRenderer>(kernels);
}

absl::StatusOr<std::shared_ptr<Renderer>> CreateCpuRenderer() {
  return std::shared_ptr<Renderer>(std::make_shared<CpuRenderer>(BestKernels()));
}

}  // namespace touchstone::image
