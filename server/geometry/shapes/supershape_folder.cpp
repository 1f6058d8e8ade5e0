// The folder meshes/: the five built-in supershapes as files, with a manifest. Made by code, never by hand.
#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "server/base/files/file_writer.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/geometry/files/mesh_file.h"
#include "server/geometry/shapes/supershape.h"

namespace touchstone::geometry {
namespace {

using Json = nlohmann::ordered_json;

Json FormulaJson(const Superformula& f) {
  return {{"m", f.m}, {"n1", f.n1}, {"n2", f.n2}, {"n3", f.n3}, {"a", f.a}, {"b", f.b}};
}

}  // namespace

absl::StatusOr<std::vector<NamedText>> SupershapeFolderFiles() {
  TOUCHSTONE_ASSIGN_OR_RETURN(const SupershapeSegments segments,
                              SegmentsForTriangles(kSupershapeFolderTriangles));
  std::vector<NamedText> files;
  Json meshes = Json::array();
  for (const std::string& name : SupershapeNames()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const SupershapeParameters parameters, NamedSupershape(name));
    TOUCHSTONE_ASSIGN_OR_RETURN(const TriangleMesh mesh, MakeSupershape(parameters, segments));
    Json written = Json::array();
    for (const std::string& format : WritableMeshFormatNames()) {
      TOUCHSTONE_ASSIGN_OR_RETURN(std::string text, MeshFileText(mesh, format));
      const std::string file = absl::StrCat(name, ".", format);
      written.push_back({{"file", file}, {"bytes", text.size()}, {"sha256", Sha256Hex(text)}});
      files.push_back({file, std::move(text)});
    }
    meshes.push_back({{"name", name},
                      {"files", written},
                      {"unit", "mm"},
                      {"up", "z"},
                      {"vertices", mesh.vertices_m.size()},
                      {"triangles", mesh.triangles.size()},
                      {"mesh_hash", MeshHash(mesh)},
                      {"origin",
                       {{"formula", "gielis_supershape"},
                        {"longitude", FormulaJson(parameters.longitude)},
                        {"latitude", FormulaJson(parameters.latitude)},
                        {"width_mm", FromSi(Unit::kMillimetre, parameters.width_m)},
                        {"segments_around", segments.around},
                        {"segments_from_pole_to_pole", segments.from_pole_to_pole}}},
                      {"licence", "made by this project's own code; the project's licence applies"}});
  }
  files.push_back({"manifest.json", Json({{"touchstone", "meshes/1"}, {"meshes", meshes}}).dump(1) + "\n"});
  return files;
}

absl::Status WriteSupershapeFolder(const std::string& folder) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<NamedText> files, SupershapeFolderFiles());
  for (const NamedText& file : files)
    TOUCHSTONE_RETURN_IF_ERROR(WriteFileAtomically(absl::StrCat(folder, "/", file.file), file.text));
  return absl::OkStatus();
}

}  // namespace touchstone::geometry
