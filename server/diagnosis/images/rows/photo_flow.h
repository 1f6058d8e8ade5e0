// How the contours of a photograph change with what moves the rays, from where the points of the surface go.
//
// A contour that crosses pixels of which each is sampled at its centre changes by whole pixels: a difference of two
// simulations holds, beside the change, which pixels happened to flip, and the same pixels flip in what a fit leaves.
// Points of the surface move smoothly, and a contour moves with the points on its near side.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "server/image/photograph/simulate_photo.h"

namespace touchstone::diagnosis::images {

// Displacements of the picture, px: of each pixel that sees the object, and of those around it.
struct PictureFlow {
  std::vector<Eigen::Vector2f> move_px;  // [row * width + column]; 0 far from the object
  float farthest_px = 0;                 // of pixels that see the object
};

// `photo`: with details, as the simulator `from` sees it. Of pixels where `wanted` is above 0.
PictureFlow FlowOfPicture(const image::PhotoRequest& request, const image::Photo& photo,
                          const std::vector<float>& wanted, const image::PhotoSimulator& from,
                          const image::PhotoSimulator& to);

// The change of the picture by the flow, to first order: what flows into each pixel. `grey`: of the photo.
std::vector<float> CarriedBy(const PictureFlow& flow, const image::Photo& photo,
                             const std::vector<float>& grey);

}  // namespace touchstone::diagnosis::images
