// For tests: where they find files. The paths stand in one generated file (cmake/touchstone.cmake), so that what includes
// this header compiles to the same object in every clone, which ccache then finds.
#pragma once

#include <string>

namespace touchstone {

std::string SourceDir();   // of the repository
std::string SharedData();  // measurements, meshes and pictures beside it; may be missing

}  // namespace touchstone
