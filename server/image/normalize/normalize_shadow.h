// Whether what lies beside a region is its shadow on the ground or a part of the same object.
//
// Where an object's outline meets the outline of its shadow, the object's own runs on smoothly and both together turn
// inwards; where it meets the edge of its dark side, both together run on smoothly and the bright part alone has a corner
// (good continuation at T-junctions). No level of grey decides.
#pragma once

#include "server/image/normalize/normalize_region.h"

namespace touchstone::image {

struct Beside {
  size_t pixels = 0;        // of the whole that are not of the part
  double border_slope = 0;  // mean of `slope` along the border between the two, per pixel
  // Where part, rest and ground meet: how far the outlines of the part and of the whole depart from straight ones, 0 to 0.5.
  double part_bend = 0, whole_bend = 0;
  int junctions = 0;  // pixels where they meet
};

// `part` lies within `around`; the whole is the part and what `around` has beside it, without the thin rim that blur leaves.
Beside LookBeside(const Region& part, const Region& around, const Plane& slope);

// The region with gaps and slits of up to twice `reach` pixels filled.
Region Closed(const Region& region, int reach);

}  // namespace touchstone::image
