// A photograph as a model expects it: commanded camera pose -> camera pose -> projection -> shading -> image sensor. A
// pure function of the request and the model. Computed by rays on the processor, so that every pixel of a distorted
// lens looks along its own ray; without effects it is the picture of the CPU renderer.
//
// The lamps stand where the commanded camera and the nominal object put them (shading.h): an error of the camera's pose
// or of the object's moves no lamp, and `light_position` counts in the axes of the commanded camera.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/effects/photo_settings.h"
#include "server/geometry/surface/surface.h"
#include "server/image/image.h"
#include "server/image/photograph/photograph.h"
#include "server/image/scene/view.h"
#include "server/model/model.h"

namespace touchstone::image {

// What is photographed, from where, through what. Pixel centres lie at half-integers: `lens.cx_px` is width / 2 for an
// ideal pinhole (photograph.h's PinholeIntrinsics counts from pixel centres and is half a pixel less).
struct PhotoRequest {
  std::shared_ptr<const geometry::Surface> surface;  // the nominal mesh
  std::string object;                                // whose values of per-object effects act
  Camera camera;    // commanded: eye, at, up in the object frame; its field of view is not read
  Intrinsics lens;  // nominal; distortion k1 k2 p1 p2 k3
  double session_time_s = 0;
  uint64_t seed = 0, index = 0;  // of the noise
};

// One channel. Arrays are height x width, rows from the top.
struct Photo {
  int width = 0, height = 0;
  std::vector<float> grey;      // expected, before noise and rounding, 0 to 255
  PixelBox varied;              // pixels outside which all grey levels are the same
  std::vector<uint8_t> pixels;  // with noise, rounded; empty unless asked
  std::vector<uint8_t> mask;    // 255: the object
  // Of the surface at each pixel, only if asked; 0 on the background.
  std::vector<float> depth_m, incidence_rad, light;
  std::vector<Eigen::Vector3f>
      point_m;  // of the mesh, before effects move it: object frame of the nominal object
};

struct PhotoOutputs {
  bool pixels = false;   // draw the noise and round
  bool details = false;  // depth_m, incidence_rad, light, point_m
};

// What one thread keeps between photographs: the points that the pixels see and their light, which models that differ
// only in later stages share. One workspace per photograph makes derivatives by shading and sensor cost no rays.
class PhotoWorkspace {
 public:
  PhotoWorkspace();
  ~PhotoWorkspace();

 private:
  friend class PhotoSimulator;
  struct Kept;
  std::unique_ptr<Kept> kept_;
};

class PhotoSimulator {
 public:
  // Effects of touches are ignored, but for those that move the surface (Effect::moves_surface).
  explicit PhotoSimulator(std::shared_ptr<const model::Model> model);
  ~PhotoSimulator();

  // Safe to call from several threads, each with a workspace of its own (null: none). Errors: a request that
  // ValidateImageRequest would refuse, a lens that sees nothing, a formula that gives no finite number.
  absl::StatusOr<Photo> Run(const PhotoRequest& request, const PhotoOutputs& outputs,
                            PhotoWorkspace* workspace) const;

  // Where points of the nominal mesh lie in the picture, px: column, row; pixel centres at half-integers. NaN behind the
  // camera. Whether something hides them does not count.
  std::vector<Eigen::Vector2d> Project(const PhotoRequest& request,
                                       const std::vector<Eigen::Vector3f>& points_m) const;

  // What the model's effects make of the settings for one object.
  effects::PhotoSettings SettingsFor(const std::string& object) const;

 private:
  std::shared_ptr<const model::Model> model_;
};

}  // namespace touchstone::image
