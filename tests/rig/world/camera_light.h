// The light that single rays bring into the emulated camera, from the words of server/image/scene/shading.h: two point lights
// that stand on the camera, a white matte surface, no shadows. Double precision and one ray each, so that a lens of any
// shape sees edges as sharp as they are.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Geometry>

#include "server/geometry/surface/surface.h"
#include "server/image/scene/shading_mesh.h"

namespace touchstone::rig {

class CameraLight {
 public:
  explicit CameraLight(std::shared_ptr<const geometry::Surface> surface);

  const std::shared_ptr<const geometry::Surface>& surface() const { return surface_; }
  // Linear light, white at 1, of rays through these points one step before the eye (right, down) of a camera that stands
  // at `from_camera` (z ahead, y down). The lights keep to `lights_from`, the pose that the camera was meant to have.
  // `ground` where a ray meets nothing.
  std::vector<double> Along(const std::vector<Eigen::Vector2d>& rays, const Eigen::Affine3d& from_camera,
                            const Eigen::Affine3d& lights_from, double ground) const;

 private:
  const std::shared_ptr<const geometry::Surface> surface_;
  const image::ShadingMesh shading_;  // for its normals
};

}  // namespace touchstone::rig
