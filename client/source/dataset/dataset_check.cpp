#include "client/source/dataset/dataset_check.h"

#include <absl/strings/str_cat.h>

#include <filesystem>
#include <map>

#include "client/source/dataset/dataset_folder.h"
#include "client/source/dataset/dataset_manifest.h"
#include "client/source/dataset/shard_writer.h"
#include "server/base/status.h"

namespace touchstone::client {

absl::StatusOr<DatasetCheck> CheckDataset(const std::string& folder,
                                          const std::function<void(uint64_t, uint64_t)>& on_shard) {
  // Parallel jobs that have not all ended have a manifest each.
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<DatasetManifest> manifests, ReadManifests(folder));
  if (manifests.empty())
    return absl::NotFoundError(
        absl::StrCat(folder, ": there is no ", kManifestName, "; give the folder of a dataset"));
  DatasetLayout layout;
  layout.folder = folder;
  const nlohmann::ordered_json& identity = manifests.front().identity;
  TOUCHSTONE_ASSIGN_OR_RETURN(layout.format, ParseShardFormat(identity["format"].get<std::string>()));
  layout.samples = identity["samples"];
  layout.shard_size = identity["shard_size"];
  std::map<uint64_t, FinishedShard> listed;
  for (const DatasetManifest& manifest : manifests)
    listed.insert(manifest.shards.begin(), manifest.shards.end());

  DatasetCheck check;
  check.samples = layout.samples;
  check.shards = layout.ShardCount();
  for (uint64_t shard = 0; shard < check.shards; ++shard) {
    const std::string name = layout.ShardName(shard);
    const auto known = listed.find(shard);
    std::error_code error;
    const bool there = std::filesystem::exists(std::filesystem::path(folder) / name, error);
    if (!there) {
      check.missing.push_back(name);
    } else if (known == listed.end()) {
      check.unlisted.push_back(name);
    } else {
      TOUCHSTONE_ASSIGN_OR_RETURN(const FinishedShard found, ReadFinishedShard(layout, shard));
      const std::string difference = DifferenceOf(found, known->second);
      if (difference.empty())
        ++check.shards_whole;
      else
        check.changed.push_back(absl::StrCat(name, " ", difference));
    }
    if (on_shard) on_shard(shard + 1, check.shards);
  }
  return check;
}

}  // namespace touchstone::client
