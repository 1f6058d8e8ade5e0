// What lies in the folder of a dataset.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "client/source/dataset/dataset_manifest.h"

namespace touchstone::client {

// "shard-000012.tar", "shard-000012", "shard-000012.h5" and their .part; nothing else in a folder is ours.
bool IsShardName(const std::string& name);
// "dataset.json" and the jobs' "dataset.job-1-of-4.json", with their .part.
bool IsManifestName(const std::string& name);
// The same without those that are being written.
bool IsWholeManifest(const std::filesystem::path& path);

// Sorted; empty if the folder cannot be read.
std::vector<std::filesystem::path> ListFolder(const std::string& folder);

// Every whole manifest in the folder. One that another job removes meanwhile is left out.
absl::StatusOr<std::vector<DatasetManifest>> ReadManifests(const std::string& folder);
// One of them.
absl::StatusOr<DatasetManifest> ReadManifest(const std::filesystem::path& path);

// How a shard on the disk differs from what the manifest says of it: "has 10 bytes, but dataset.json says 12"; empty if it
// does not.
std::string DifferenceOf(const FinishedShard& found, const FinishedShard& listed);

}  // namespace touchstone::client
