// Meshes in another unit than the file's lengths. The touches all miss such a mesh, or stand within it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/checks/tried.h"

namespace touchstone::diagnosis::checks {

struct MeshUnit {
  std::vector<std::string> objects;  // whose meshes are in this unit
  std::string unit;                  // of --mesh NAME=FILE,unit=..., or "" where that has no word for it
  double factor = 1;                 // on the mesh, to be right
  DiagnosisInput fixed;              // the input with these meshes in the right size
};

// The unit that explains the misfit of the objects whose size tells that their mesh is another number of times larger
// or smaller than what was touched. Other objects may be right as they are.
std::optional<MeshUnit> WrongMeshUnit(const Trial& trial, const TrialResult& before);

}  // namespace touchstone::diagnosis::checks
