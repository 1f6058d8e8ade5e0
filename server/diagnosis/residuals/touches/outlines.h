// Coarse copies of the objects' meshes, for drawing.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/touches/observations.h"
#include "server/geometry/mesh/mesh.h"

namespace touchstone::diagnosis::residuals {

// At most `max_triangles` triangles that follow the mesh: vertices in one cell of the finest grid that is
// coarse enough become one, at their mean (Rossignac and Borrel 1993).
geometry::TriangleMesh Decimated(const geometry::TriangleMesh& mesh, int max_triangles);

struct DrawableObject {
  std::string object;
  geometry::TriangleMesh mesh;  // at most 400 triangles, object frame
};

// Every object that has a surface.
std::vector<DrawableObject> MakeOutlines(const touches::Observations& observations);

}  // namespace touchstone::diagnosis::residuals
