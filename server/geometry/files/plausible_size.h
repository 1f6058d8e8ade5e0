// Whether an object is of a size that a hand can touch: a mesh read in the wrong unit is not.
#pragma once

#include <string>

#include "server/geometry/mesh/mesh.h"

namespace touchstone::geometry {

// What is wrong with the size of an object for fingers that span `hand_span_m` (metres, > 0), and which unit or scale
// at import would be right, as one sentence; empty if the size is plausible: the longest side of the box between a
// quarter of the span and fifty times it. `unit` is what the file's coordinates were read in (one of MeshUnitNames()).
std::string SizeNote(const Bounds& bounds, double hand_span_m, const std::string& unit = "mm");

}  // namespace touchstone::geometry
