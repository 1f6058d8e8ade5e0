// A mesh whose surface is moved along its normals: the surface as it was measured.
#pragma once

#include <functional>
#include <vector>

#include <absl/status/statusor.h>

#include "server/geometry/mesh/mesh.h"

namespace touchstone::geometry {

// The same surface with no edge longer than `max_edge_m`: long edges are halved until none is left, in all triangles that
// share them, so that no gap opens. RESOURCE_EXHAUSTED if it takes more than `max_triangles`.
absl::StatusOr<TriangleMesh> WithShortEdges(TriangleMesh mesh, double max_edge_m, uint64_t max_triangles);

// Moves every vertex so that each face around it moves by `distance_m` at the vertex along its own outward normal (least
// squares, weighted by angle): on an edge of a cube farther than on its faces. Vertices at one place stay together.
TriangleMesh MovedAlongNormals(TriangleMesh mesh,
                               const std::function<double(const Eigen::Vector3d& point_m)>& distance_m);

// A third of the area of the triangles round each vertex, m2.
std::vector<double> AreaOfVertices(const TriangleMesh& mesh);

}  // namespace touchstone::geometry
