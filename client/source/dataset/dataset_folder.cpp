#include "client/source/dataset/dataset_folder.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

#include "client/source/dataset/synced_file.h"
#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::client {
namespace fs = std::filesystem;

constexpr uint64_t kMaxManifestBytes = uint64_t{1} << 30;

bool IsShardName(const std::string& name) {
  const std::string prefix = "shard-";
  if (name.rfind(prefix, 0) != 0) return false;
  const size_t end = name.find_first_not_of("0123456789", prefix.size());
  const std::string rest = end == std::string::npos ? "" : name.substr(end);
  return end != prefix.size() && (rest.empty() || rest == ".tar" || rest == ".h5" || rest == ".part" ||
                                  rest == ".tar.part" || rest == ".h5.part");
}

bool IsManifestName(const std::string& name) {
  return name == kManifestName || IsUnfinishedName(name) ||
         // As earlier versions named it until it was whole.
         name == absl::StrCat(kManifestName, kPartSuffix) ||
         (name.rfind("dataset.job-", 0) == 0 && name.find(".json") != std::string::npos);
}

std::vector<fs::path> ListFolder(const std::string& folder) {
  std::vector<fs::path> paths;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    paths.push_back(entry->path());
  std::sort(paths.begin(), paths.end());
  return paths;
}

bool IsWholeManifest(const fs::path& path) {
  return IsManifestName(path.filename().string()) && path.extension() == ".json";
}

absl::StatusOr<DatasetManifest> ReadManifest(const fs::path& path) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(path.string(), kMaxManifestBytes));
  return ParseManifest(text, path.string());
}

absl::StatusOr<std::vector<DatasetManifest>> ReadManifests(const std::string& folder) {
  std::vector<DatasetManifest> manifests;
  for (const fs::path& path : ListFolder(folder)) {
    if (!IsWholeManifest(path)) continue;
    absl::StatusOr<DatasetManifest> manifest = ReadManifest(path);
    if (absl::IsNotFound(manifest.status())) continue;
    TOUCHSTONE_RETURN_IF_ERROR(manifest.status());
    manifests.push_back(*std::move(manifest));
  }
  return manifests;
}

std::string DifferenceOf(const FinishedShard& found, const FinishedShard& listed) {
  if (found.bytes != listed.bytes)
    return absl::StrCat("has ", found.bytes, " bytes, but ", kManifestName, " says ", listed.bytes);
  if (found.sha256 != listed.sha256)
    return absl::StrCat("has the SHA-256 ", found.sha256.substr(0, 12), "..., but ", kManifestName, " says ",
                        listed.sha256.substr(0, 12), "...");
  return "";
}

}  // namespace touchstone::client
