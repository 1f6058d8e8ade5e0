// Camera poses from which a photograph could be taken next.
#pragma once

#include <cstdint>
#include <vector>

#include "server/diagnosis/images/photographs.h"

namespace touchstone::diagnosis::design {

struct ViewCandidate {
  int object = 0;                   // index into the photographs' objects
  session::CameraPlacement camera;  // object frame, m
};

// About `max_views` views, as many of every object: 0.5 to 2 times the median distance so far, all round, upright and
// turned by 90 deg about the viewing axis, the object in the middle of the picture or towards a corner. The whole object
// lies in the picture of the nominal lens. Where no photograph of any object was taken from below its underside, a table
// is taken to be there, and no view is lower than 5 deg above it. Fewer, or none, where the object is too large for that.
std::vector<ViewCandidate> ListViews(const images::Photographs& photographs, int max_views, uint64_t seed);

// Whether the corners of the object's bounding box lie in the picture of the nominal lens, none nearer to its rim than
// `margin` (a share of the picture's shorter side).
bool IsInPicture(const images::Photographs& photographs, const ViewCandidate& view, double margin);

// `count` of the candidates, each as far as possible from the directions and distances of its object's photographs and of
// those chosen before; objects with few photographs first.
std::vector<ViewCandidate> MostDifferentViews(const images::Photographs& photographs,
                                              const std::vector<ViewCandidate>& candidates, int count);

}  // namespace touchstone::diagnosis::design
