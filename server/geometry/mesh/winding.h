// Parts of a mesh that are wound the wrong way round: their triangles run clockwise seen from outside.
#pragma once

#include <cstdint>
#include <vector>

#include "server/geometry/mesh/mesh.h"

namespace touchstone::geometry {

// The triangles, in rising order, that must be turned so that every closed part runs counter-clockwise seen from outside.
// A part is what hangs together by edges with two triangles; vertices at exactly the same place are one. Parts with an open
// edge or without two sides have no outside and stay; a part whose box lies within another's may be a cavity, so that only
// its minority is turned.
std::vector<uint32_t> WronglyWound(const TriangleMesh& mesh);

void Turn(const std::vector<uint32_t>& triangles, TriangleMesh* mesh);

}  // namespace touchstone::geometry
