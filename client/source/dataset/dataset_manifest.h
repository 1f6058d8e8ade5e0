// dataset.json: what a dataset is and what it consists of. It holds no wall-clock time and nothing of the
// machine, so equal datasets have equal manifests.
#pragma once

#include <map>
#include <string>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "client/source/dataset/shard_writer.h"
#include "touchstone/v1/source.pb.h"

namespace touchstone::client {

inline constexpr char kManifestName[] = "dataset.json";
inline constexpr char kManifestFormat[] = "dataset/1";

struct DatasetManifest {
  // Everything that decides the bytes: specification, model, meshes, columns, shards' size, versions.
  nlohmann::ordered_json identity;
  std::map<uint64_t, FinishedShard> shards;  // by number: the finished ones
};

// The identity of a dataset from what the user asked for and what the source resolved.
nlohmann::ordered_json MakeIdentity(const v1::DatasetSpec& spec, const v1::DatasetHeader& header,
                                    const DatasetLayout& layout);

// Reads the specification back from a manifest, model file included, so that the dataset can be made again.
absl::StatusOr<v1::DatasetSpec> SpecOfManifest(const nlohmann::ordered_json& manifest,
                                               const std::string& origin);

// A specification as JSON in the units of files, without the model.
nlohmann::ordered_json SpecToJson(const v1::DatasetSpec& spec);

// The whole file. `complete` says whether all shards of the dataset are there.
std::string FormatManifest(const DatasetManifest& manifest, bool complete);

// Reads what FormatManifest wrote; the error names the file.
absl::StatusOr<DatasetManifest> ParseManifest(const std::string& text, const std::string& origin);

// Where two identities differ: "specification.seed: 1 there, 2 now", a line each; empty if they are equal.
std::vector<std::string> DiffIdentities(const nlohmann::ordered_json& there,
                                        const nlohmann::ordered_json& now);

// "RENDERER_KIND_CPU" <-> "cpu".
std::string RendererName(v1::RendererKind kind);
v1::RendererKind RendererOfName(const std::string& name);

}  // namespace touchstone::client
