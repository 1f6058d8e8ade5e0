// How a surface point becomes a grey level: one model for both renderers, in words here, in C++ in
// cpu_kernels_template.h and in GLSL in egl_shader.h. Who changes one changes all three; the image tests compare
// them.
//
//   shade = kAmbient + sum over lights of strength * max(0, n . l) / (|n| |l|)
//   grey  = floor(255 * min(1, shade) * scale + 0.5),   scale = 1 (kShaded) or kDarkScale (kDarkOnWhite)
//
// n is the interpolated normal (not normalised before), l the vector from the surface point to a point light.
// White matte (Lambert) surface, white lights, no attenuation with distance, no shadows; single precision.
// On surfaces that can be seen from both sides, n is turned with the face towards the viewer.
// Background: 0 in kShaded, 255 in kDarkOnWhite.
//
// The lights stand on the camera, so that every view of an object is equally well lit: they turn with the
// image's axes, around the object's centre, at distances that are multiples of the radius of its bounding
// sphere. A camera that comes nearer changes the size of the object in the image, not its light.
#pragma once

#include <array>

#include "server/geometry/mesh/mesh.h"
#include "server/image/image.h"
#include "server/image/scene/view.h"

namespace touchstone::image {

// Neighbouring triangles that meet at a sharper angle than this do not share a normal: the edge stays
// visible.
inline constexpr double kCreaseRad = 0.61086523819801535;  // 35 deg

inline constexpr float kAmbient = 0.07f;
inline constexpr float kDarkScale =
    0.42f;  // a white surface in full light is 107 of 255 on a white background

// A point light in the axes of the image, in multiples of the bounding sphere's radius from its centre.
struct LightPlace {
  double right;
  double up;
  double towards_eye;
  float strength;
};
inline constexpr std::array<LightPlace, 2> kLights = {{
    {-3.5, 4.0, 4.0, 0.88f},  // key: from above left, so that bulges look like bulges
    {4.0, -1.0, 2.5, 0.26f},  // fill: from the right, so that no visible side is black
}};

struct Lighting {
  std::array<std::array<float, 3>, kLights.size()> position_m;  // object frame
  float scale = 1;                                              // shade to grey / 255
  uint8_t background = 0;
};

inline Lighting MakeLighting(const View& view, const geometry::Bounds& bounds, ShadingStyle style) {
  Lighting lighting;
  const double radius_m = 0.5 * bounds.DiagonalM();
  for (size_t i = 0; i < kLights.size(); ++i) {
    const LightPlace& place = kLights[i];
    const Eigen::Vector3d position =
        bounds.Centre() +
        radius_m * (place.right * view.right + place.up * view.up - place.towards_eye * view.forward);
    for (int axis = 0; axis < 3; ++axis) lighting.position_m[i][axis] = static_cast<float>(position[axis]);
  }
  if (style == ShadingStyle::kDarkOnWhite) {
    lighting.scale = kDarkScale;
    lighting.background = 255;
  }
  return lighting;
}

}  // namespace touchstone::image
