// Mesh files in and out: OFF, OBJ, STL (text and binary) and PLY (text and binary, both byte orders).
//
// A file says neither its unit nor which way is up, so the caller says both; nothing is guessed. Polygons are
// triangulated, also concave ones; textures, normals and colours are passed over. Memory follows the file's
// size: a count in a header is trusted only as far as the bytes behind it go.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "server/geometry/mesh/mesh.h"

namespace touchstone::geometry {

// How the numbers of a mesh file become metres in the object frame (right-handed, z up).
struct MeshImport {
  std::string unit = "mm";       // of the file's coordinates: one of MeshUnitNames()
  std::string up = "z";          // the file's axis that points up: one of MeshUpAxisNames()
  double scale = 1;              // a further factor, > 0
  std::optional<double> fit_mm;  // instead of unit and scale: the longest side of the bounding box, > 0

  // What is refused.
  uint64_t max_bytes = uint64_t{2} << 30;
  uint64_t max_vertices = 12'000'000;
  uint64_t max_triangles = 4'000'000;
};

std::vector<std::string> MeshUnitNames();  // mm, cm, m, inch
absl::StatusOr<double> MetresPerMeshUnit(
    const std::string& unit);                // INVALID_ARGUMENT names the nearest known one
std::vector<std::string> MeshUpAxisNames();  // z, y (turned by 90 deg about x), x (by -90 deg about y)
std::vector<std::string> MeshFormatNames();  // what ReadMeshFile reads: off, obj, stl, ply
std::vector<std::string> WritableMeshFormatNames();  // what WriteMeshFile writes: off, obj

// The format of a file: its extension, in any case, or, where that names none, what its bytes begin with. INVALID_ARGUMENT
// where neither says it.
absl::StatusOr<std::string> MeshFormatOf(const std::string& path, absl::string_view bytes);

// Reads a mesh of the format that MeshFormatOf gives. Text may be UTF-8 or UTF-16. Errors name the file, the line (or byte), what
// was found there and what would be right. `notes`, if given, receives a line for everything that was passed
// over and that a user may want to know (a face with two corners, bytes behind the last triangle). Vertices
// and triangles keep the file's order; an STL's equal vertices become one.
absl::StatusOr<TriangleMesh> ReadMeshFile(const std::string& path, const MeshImport& import = {},
                                          std::vector<std::string>* notes = nullptr);

// The same for bytes in memory; `name` stands in messages where the path would, `format` is one of
// MeshFormatNames().
absl::StatusOr<TriangleMesh> ReadMeshBytes(const std::string& name, absl::string_view format,
                                           absl::string_view bytes, const MeshImport& import = {},
                                           std::vector<std::string>* notes = nullptr);

// Writes a mesh in millimetres, z up; the extension names the format (OFF or OBJ). Every coordinate is the
// shortest number that ReadMeshFile turns into the same float. The file is whole or absent.
absl::Status WriteMeshFile(const std::string& path, const TriangleMesh& mesh);

// The text of such a file.
absl::StatusOr<std::string> MeshFileText(const TriangleMesh& mesh, absl::string_view format);

}  // namespace touchstone::geometry
