// A coarse copy of a mesh, for drawing.
#pragma once

#include "server/geometry/mesh.h"

namespace touchstone {

// At most `max_triangles` triangles that follow the mesh: vertices in one cell of the finest grid that is
// coarse enough become one, at their mean (Rossignac and Borrel 1993).
TriangleMesh Decimated(const TriangleMesh& mesh, int max_triangles);

}  // namespace touchstone
