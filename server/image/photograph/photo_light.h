// The linear light of what a photograph sees, the model of shading.h with what effects change of it. Part of the
// simulation of photographs only.
#pragma once

#include <vector>

#include "server/effects/photo_settings.h"
#include "server/image/photograph/photo_points.h"

namespace touchstone::image {

// How the lamps stand to every point of PhotoPoints.
struct PhotoLamps {
  std::vector<float> key_cosine, fill_cosine;  // 0 where the lamp stands behind the surface
  std::vector<float> half_cosine;  // of the normal and the vector halfway between key light and eye
  std::vector<uint8_t> in_shadow;  // of the key light, 1: yes; empty until asked
};

// Positions of the lamps in the mesh's frame. They belong to the commanded camera and the nominal object: an error of
// the camera's or of the object's pose moves no lamp.
struct LampPlaces {
  Eigen::Vector3d key_m, fill_m;
};
LampPlaces PlaceLamps(const Camera& commanded, const geometry::Bounds& bounds,
                      const effects::PhotoSettings& settings, const SurfacePlace& place);

void FindLamps(const PhotoPoints& points, const LampPlaces& lamps, PhotoLamps* result);
// Rays from every point that the key light shines on.
void FindShadows(const geometry::Surface& surface, const PhotoPoints& points, const LampPlaces& lamps,
                 PhotoLamps* result);

// Light of each point, not clipped.
void FillLight(const PhotoPoints& points, const PhotoLamps& lamps, const effects::PhotoSettings& settings,
               std::vector<float>* light);

}  // namespace touchstone::image
