// Meshes into OFF and OBJ.
#include <absl/strings/ascii.h>
#include <absl/strings/charconv.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <charconv>
#include <cmath>

#include "server/base/files/file_writer.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/geometry/files/mesh_file.h"

namespace touchstone::geometry {
namespace {

// Appends the shortest number of millimetres that reads back as the same float of metres. A float's
// neighbours are at least 6e-8 of it away, so that what holds at six digits cannot be said in fewer; only
// denormal numbers are coarser.
void AppendMillimetres(float value_m, std::string* text) {
  const double value_mm = value_m / kMetresPerMillimetre;
  char digits[40];
  for (int precision = std::abs(value_m) < 1e-30f ? 1 : 6;; ++precision) {
    const auto end =
        std::to_chars(digits, digits + sizeof digits, value_mm, std::chars_format::general, precision);
    double read = 0;
    std::from_chars(digits, end.ptr, read);
    if (precision < 17 && static_cast<float>(read * kMetresPerMillimetre) != value_m) continue;
    // A zero has no sign in a file.
    absl::StrAppend(text, value_m == 0 ? "0" : absl::string_view(digits, end.ptr - digits));
    return;
  }
}

void AppendWhole(uint64_t value, std::string* text) {
  char digits[24];
  text->append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr - digits);
}

absl::Status CheckWritable(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) return absl::InvalidArgumentError("the mesh has no triangle to write");
  for (size_t v = 0; v < mesh.vertices_m.size(); ++v)
    if (!mesh.vertices_m[v].allFinite())
      return absl::InvalidArgumentError(absl::StrCat("vertex ", v, " of the mesh is not finite"));
  for (size_t t = 0; t < mesh.triangles.size(); ++t)
    for (uint32_t corner : mesh.triangles[t])
      if (corner >= mesh.vertices_m.size())
        return absl::InvalidArgumentError(
            absl::StrCat("triangle ", t, " uses vertex ", corner, " of ", mesh.vertices_m.size()));
  return absl::OkStatus();
}

// `vertex` and `face` begin a line, `first` is the number of the first vertex.
void AppendBody(const TriangleMesh& mesh, absl::string_view vertex, absl::string_view face, uint64_t first,
                std::string* text) {
  for (const Eigen::Vector3f& place_m : mesh.vertices_m) {
    absl::StrAppend(text, vertex);
    for (int k = 0; k < 3; ++k) {
      if (k > 0) text->push_back(' ');
      AppendMillimetres(place_m[k], text);
    }
    text->push_back('\n');
  }
  for (const auto& triangle : mesh.triangles) {
    absl::StrAppend(text, face);
    for (int c = 0; c < 3; ++c) {
      text->push_back(' ');
      AppendWhole(triangle[c] + first, text);
    }
    text->push_back('\n');
  }
}

}  // namespace

std::vector<std::string> WritableMeshFormatNames() {
  return {"off", "obj"};
}

absl::StatusOr<std::string> MeshFileText(const TriangleMesh& mesh, absl::string_view format) {
  TOUCHSTONE_RETURN_IF_ERROR(CheckWritable(mesh));
  std::string text;
  text.reserve(33 * mesh.vertices_m.size() + 24 * mesh.triangles.size());
  if (format == "off") {
    absl::StrAppend(&text, "OFF\n", mesh.vertices_m.size(), " ", mesh.triangles.size(), " 0\n");
    AppendBody(mesh, "", "3", 0, &text);
  } else if (format == "obj") {
    absl::StrAppend(&text, "# unit: mm, up: z\n");
    AppendBody(mesh, "v ", "f", 1, &text);
  } else {
    return absl::InvalidArgumentError(absl::StrCat("meshes are not written as '", format, "'", "; known: ",
                                                   absl::StrJoin(WritableMeshFormatNames(), ", ")));
  }
  return text;
}

absl::Status WriteMeshFile(const std::string& path, const TriangleMesh& mesh) {
  const size_t dot = path.find_last_of("./");
  const std::string extension =
      dot == std::string::npos || path[dot] == '/' ? "" : absl::AsciiStrToLower(path.substr(dot + 1));
  const absl::StatusOr<std::string> text = MeshFileText(mesh, extension);
  if (!text.ok())
    return absl::Status(text.status().code(), absl::StrCat(path, ": ", text.status().message()));
  return WriteFileAtomically(path, *text);
}

}  // namespace touchstone::geometry
