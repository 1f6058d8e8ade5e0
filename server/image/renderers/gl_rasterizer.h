// Draws images with the OpenGL context that is current on the thread. Part of the EGL renderer only.
//
// The picture is drawn upside down in OpenGL's sense (clip space's y points down), so that the first row that
// OpenGL hands out is the image's top and nothing need be turned round afterwards.
#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/geometry/surface/surface.h"
#include "server/image/image.h"
#include "server/image/scene/shading_mesh.h"

namespace touchstone::image {

class GlRasterizer {
 public:
  // Compiles the shaders. Create, use and destroy it with the same context current.
  static absl::StatusOr<std::unique_ptr<GlRasterizer>> Create();
  ~GlRasterizer();
  GlRasterizer(const GlRasterizer&) = delete;
  GlRasterizer& operator=(const GlRasterizer&) = delete;

  const std::string& gl_renderer() const { return gl_renderer_; }

  // The request must be valid. `mesh` is the surface's.
  absl::StatusOr<Image> Draw(const std::shared_ptr<const geometry::Surface>& surface, const ShadingMesh& mesh,
                             const Camera& camera, const ImageOptions& options);

 private:
  // A mesh in the driver's memory, kept while its surface lives, within limits.
  struct Buffers {
    std::weak_ptr<const geometry::Surface> surface;
    uint32_t vertex_array = 0;
    uint32_t vertices = 0;
    uint32_t corners = 0;
    uint64_t bytes = 0;
  };
  static constexpr size_t kMaxMeshes = 64;
  static constexpr uint64_t kMaxBytes = uint64_t{1} << 30;

  // What the frame buffer has; it is made anew when this changes.
  struct Target {
    int width = 0;
    int height = 0;
    bool depth = false;
    bool mask = false;
    bool operator==(const Target& other) const {
      return width == other.width && height == other.height && depth == other.depth && mask == other.mask;
    }
  };

  GlRasterizer() = default;
  absl::Status CompileProgram();
  absl::Status PrepareTarget(const Target& target);
  void DeleteTarget();
  absl::StatusOr<uint32_t> VertexArrayOf(const std::shared_ptr<const geometry::Surface>& surface,
                                         const ShadingMesh& mesh);
  static void Delete(const Buffers& buffers);
  void ReadBack(const ImageOptions& options, Image* image);

  std::string gl_renderer_;
  uint32_t program_ = 0;
  int clip_from_object_ = -1, light_ = -1, ambient_ = -1, scale_ = -1;  // places of the uniforms
  Target target_;
  uint32_t frame_buffer_ = 0;
  uint32_t grey_buffer_ = 0, metres_buffer_ = 0, depth_buffer_ = 0;
  std::list<Buffers> meshes_;  // the one drawn last comes first
};

}  // namespace touchstone::image
