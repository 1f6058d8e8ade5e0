// Photographs made alike, whatever they were taken against: a dark object on a white ground, without the ground, its
// light and its shadows, and the mask of the object.
//
//   ground   a smooth surface through the picture's rim, robust against what lies on it; or a picture of the empty place
//   parting  relative grey (the logarithm of grey over ground) is cut at many levels; the region stays whose outline is
//            the steepest and which holds most of what differs from the ground: a shadow's outline is fainter than the
//            object's, so it stays outside. Adaptive: no level is fixed, and light that fades over the ground cancels
//   mask     one object or several near ones, without the ground seen through a handle; its outline is laid where the
//            grey is halfway between both sides
//   picture  the ground white; the object's grey divided by the light, as bright as a white object is in
//            ShadingStyle::kDarkOnWhite
//
// What grey alone cannot tell stays wrong: a face as bright as the ground, and a flat face as bright as a shadow that is
// seen beside it. Single images, no state; the same picture gives the same bytes.
#pragma once

#include <absl/status/statusor.h>

#include "server/image/image.h"

namespace touchstone::image {

// Sides of fewer pixels leave no rim and no object.
inline constexpr int kMinNormalizedSide = 16;

// One channel, with a mask. Where nothing parts from the ground, the picture is white and the mask empty: see FoundObject.
// `background`: the same view without the object, of the same size; null: none. INVALID_ARGUMENT: a picture that is too
// small, or a background of another size.
absl::StatusOr<Image> Normalize(const Image& photograph, const Image* background = nullptr);

// Whether the mask has a pixel.
bool FoundObject(const Image& normalized);

}  // namespace touchstone::image
