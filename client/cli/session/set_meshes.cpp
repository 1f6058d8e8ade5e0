#include "client/cli/session/set_meshes.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/geometry/files/mesh_file.h"

namespace touchstone::cli {
namespace {

namespace fs = std::filesystem;

// Of a folder with many meshes, those that the set does not name: so many are tried as what was touched.
constexpr size_t kMaxFurtherMeshes = 12;
constexpr uint64_t kMaxFurtherBytes = 32 << 20;

// Meshes that the set does not name, as far as they can be read: nobody asked for them, so none stops the command.
void AddFurtherMeshes(const Cli& cli, const std::map<std::string, std::string>& paths,
                      std::map<std::string, source::MeshSpec>* meshes) {
  size_t taken = 0;
  uint64_t bytes = 0;
  std::vector<std::string> left_out;
  for (const auto& [name, path] : paths) {
    if (meshes->count(name) > 0) continue;
    std::error_code error;
    const uint64_t size = fs::file_size(path, error);
    if (error || taken == kMaxFurtherMeshes || bytes + size > kMaxFurtherBytes) {
      left_out.push_back(name);
      continue;
    }
    if (!geometry::ReadMeshFile(path).ok()) continue;
    bytes += size, ++taken;
    source::MeshSpec source;
    source.name = name;
    source.path = path;
    meshes->emplace(name, source);
  }
  if (!left_out.empty())
    cli.Detail(absl::StrCat("--mesh-dir: ", left_out.size(), " further meshes (", left_out[0],
                            left_out.size() > 1 ? ", ..." : "",
                            ") are not tried as the mesh of another object; --mesh NAME=FILE adds one"));
}

// The mesh files of these objects in --mesh-dir. Other files there are left alone, or, with `further`, taken as far as
// the bounds allow.
absl::Status AddMeshesOfFolder(const Cli& cli, const std::string& folder,
                               const std::vector<std::string>& objects, bool further,
                               std::map<std::string, source::MeshSpec>* meshes) {
  const std::vector<std::string> formats = geometry::MeshFormatNames();
  std::map<std::string, std::string> paths, others;
  std::set<std::string> twice;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().stem().string();
    const std::string extension = absl::AsciiStrToLower(entry.path().extension().string());
    if (extension.empty() || std::find(formats.begin(), formats.end(), extension.substr(1)) == formats.end())
      continue;
    if (std::find(objects.begin(), objects.end(), name) == objects.end()) {
      others.emplace(name, entry.path().string());
      continue;
    }
    const auto [other, is_new] = paths.emplace(name, entry.path().string());
    if (is_new || meshes->count(name) > 0) continue;
    // The same object in two formats: the format that MeshFormatNames names first, and a note to the user.
    const auto rank = [&](const fs::path& path) {
      return std::find(formats.begin(), formats.end(),
                       absl::AsciiStrToLower(path.extension().string()).substr(1)) -
             formats.begin();
    };
    if (rank(entry.path()) < rank(other->second)) other->second = entry.path().string();
    twice.insert(name);
  }
  if (error) return absl::NotFoundError(absl::StrCat("--mesh-dir: '", folder, "': ", error.message()));
  for (const std::string& name : twice)
    cli.Log(absl::StrCat("note: --mesh-dir: several files are named '", name, "'; ", paths[name],
                         " is taken (--mesh ", name, "=FILE takes another)"));
  for (const auto& [name, path] : paths) {
    source::MeshSpec source;
    source.name = name;
    source.path = path;
    meshes->emplace(name, source);  // --mesh comes first
  }
  std::vector<std::string> missing;
  for (const std::string& object : objects)
    if (meshes->count(object) == 0) missing.push_back(object);
  if (!missing.empty())
    cli.Log(absl::StrCat("note: --mesh-dir: '", folder, "' has no mesh of ", absl::StrJoin(missing, ", "),
                         ": a built-in shape of that name is taken, if there is one"));
  if (further) AddFurtherMeshes(cli, others, meshes);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<source::MeshSpec>> MeshesOf(const Cli& cli,
                                                       const std::vector<std::string>& objects,
                                                       bool further) {
  std::map<std::string, source::MeshSpec> meshes;
  for (const std::string& text : cli.source().meshes) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const source::MeshSpec source, service::ParseMeshSpec(text));
    if (!meshes.emplace(source.name, source).second)
      return absl::InvalidArgumentError(
          absl::StrCat("--mesh: two are named '", source.name, "'; one per object was expected"));
    if (std::find(objects.begin(), objects.end(), source.name) == objects.end()) {
      // Kept: it may be what was touched under another name.
      cli.Log(absl::StrCat("note: --mesh ", text, ": the set has no such object",
                           DidYouMean(source.name, objects)));
    }
  }
  if (!cli.source().mesh_folder.empty())
    TOUCHSTONE_RETURN_IF_ERROR(AddMeshesOfFolder(cli, cli.source().mesh_folder, objects, further, &meshes));
  std::vector<source::MeshSpec> list;
  for (const auto& [name, source] : meshes) list.push_back(source);
  return list;
}

}  // namespace touchstone::cli
