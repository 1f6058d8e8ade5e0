// What the commands on mesh files share.
#pragma once

#include <optional>
#include <string>

#include "client/cli/common/common.h"
#include "server/geometry/mesh/mesh.h"

namespace touchstone::cli {

struct MeshOptions {
  std::string input;
  std::string output;
  std::string unit = "mm";
  std::string up = "z";
  double scale = 1;
  double fit_mm = 0;
  bool center = false;
  bool outward = false;  // import: the centre of the bounding box becomes the origin
  // Supershapes.
  std::string name;
  uint64_t triangles = 20000;
  std::optional<double> width_mm;
  std::string longitude;  // "m,n1,n2,n3[,a,b]"
  std::string latitude;
  // Corrections.
  std::string map, object;
};

void AddImportOptions(CLI::App* command, MeshOptions* options);
absl::StatusOr<geometry::TriangleMesh> ReadMesh(const Cli& cli, const MeshOptions& options);
// Writes the mesh and says what it is like.
absl::Status WriteMesh(const Cli& cli, const MeshOptions& options, const geometry::TriangleMesh& mesh);

// touchstone mesh correct
absl::Status RunMeshCorrect(const Cli& cli, const MeshOptions& options);

}  // namespace touchstone::cli
