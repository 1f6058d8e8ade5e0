#include "server/source/object_store.h"

#include <absl/strings/str_cat.h>

#include <filesystem>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/geometry/files/mesh_file.h"
#include "server/geometry/shapes/supershape.h"

namespace touchstone::source {
namespace {

constexpr char kBuiltIn[] = "built-in supershape";

absl::StatusOr<ServedObject> Serve(const std::string& name, geometry::TriangleMesh mesh,
                                   const std::string& origin) {
  ServedObject object;
  object.closed = geometry::InspectMesh(mesh).closed();
  object.origin = origin;
  TOUCHSTONE_ASSIGN_OR_RETURN(object.surface, geometry::Surface::Create(name, std::move(mesh)));
  return object;
}

absl::StatusOr<ServedObject> MakeBuiltIn(const std::string& name, int triangles) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const geometry::SupershapeParameters parameters,
                              geometry::NamedSupershape(name));
  TOUCHSTONE_ASSIGN_OR_RETURN(geometry::TriangleMesh mesh, geometry::MakeSupershape(parameters, triangles));
  return Serve(name, std::move(mesh), kBuiltIn);
}

absl::StatusOr<ServedObject> ReadObject(const MeshSpec& spec) {
  geometry::MeshImport import;
  import.unit = spec.unit;
  import.up = spec.up;
  import.scale = spec.scale;
  if (spec.fit_mm > 0) import.fit_mm = spec.fit_mm;
  auto mesh = geometry::ReadMeshFile(spec.path, import);
  if (!mesh.ok()) return mesh.status();
  auto object = Serve(spec.name, *std::move(mesh), std::filesystem::path(spec.path).filename().string());
  if (!object.ok())
    return absl::Status(object.status().code(), absl::StrCat(spec.path, ": ", object.status().message()));
  return object;
}

}  // namespace

absl::StatusOr<ObjectStore> ObjectStore::Load(const std::vector<MeshSpec>& meshes, int supershape_triangles,
                                              ThreadPool* pool) {
  const std::vector<std::string> shapes = geometry::SupershapeNames();
  const int count = static_cast<int>(shapes.size() + meshes.size());
  std::vector<absl::StatusOr<ServedObject>> loaded(count, absl::UnknownError("not loaded"));
  pool->ParallelFor(count, 1, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      if (k >= static_cast<int>(shapes.size())) {
        loaded[k] = ReadObject(meshes[k - shapes.size()]);
        continue;
      }
      loaded[k] = MakeBuiltIn(shapes[k], supershape_triangles);
    }
  });
  ObjectStore store;
  for (auto& object : loaded) {
    if (!object.ok()) return object.status();
    const std::string name = object->surface->name();
    const bool replaces_builtin = store.objects_.count(name) && store.objects_[name].origin == kBuiltIn;
    if (store.objects_.count(name) && !replaces_builtin)
      return absl::InvalidArgumentError(
          absl::StrCat("two meshes are named '", name, "': give each a name of its own, --mesh NAME=FILE"));
    store.objects_[name] = *std::move(object);
  }
  return store;
}

absl::StatusOr<const ServedObject*> ObjectStore::Find(const std::string& name,
                                                      const std::string& field) const {
  const auto found = objects_.find(name);
  if (found != objects_.end()) return &found->second;
  std::vector<std::string> names;
  for (const auto& [known, object] : objects_) names.push_back(known);
  return absl::NotFoundError(
      absl::StrCat(field, ": no object is named '", name, "'", DidYouMean(name, names)));
}

}  // namespace touchstone::source
