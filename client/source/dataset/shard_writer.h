// Shards: files (or folders) that hold a fixed number of samples each. A shard is written beside its place as
// NAME.part and renamed when it is whole and synced, so what stands under its own name is always whole.
// The same samples always give the same bytes: no time stamps, no owners, no order of chance.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "client/source/dataset/batch.h"
#include "client/source/dataset/lab_units.h"

namespace touchstone::client {

enum class ShardFormat { kWebDataset, kFolder, kHdf5 };
const char* ShardFormatName(ShardFormat format);  // "webdataset", ...
absl::StatusOr<ShardFormat> ParseShardFormat(const std::string& name);

// What every shard of a dataset has in common.
struct DatasetLayout {
  ShardFormat format = ShardFormat::kWebDataset;
  std::string folder;
  uint64_t samples = 0;     // of the whole dataset
  uint64_t shard_size = 1;  // samples a shard; the last may have fewer
  std::vector<std::string> objects;
  int fingers = 3;
  std::string image_extension = "png";  // of encoded images
  std::vector<FileColumn> columns;

  uint64_t ShardCount() const { return (samples + shard_size - 1) / shard_size; }
  uint64_t FirstIndex(uint64_t shard) const { return shard * shard_size; }
  uint64_t SamplesIn(uint64_t shard) const;
  // "shard-000012.tar"; a folder's has no extension.
  std::string ShardName(uint64_t shard) const;
  // Zero-padded sample index, equally wide in the whole dataset, so that names sort by index.
  std::string Key(uint64_t index) const;
  const FileColumn* FindColumn(const std::string& wire_name) const;
};

struct FinishedShard {
  std::string name;
  uint64_t first_index = 0;
  uint64_t samples = 0;
  uint64_t bytes = 0;
  // Of the file's bytes; of a folder: of the lines "SHA-256  NAME" of its files sorted by name, as
  // sha256sum prints them.
  std::string sha256;
};

class ShardWriter {
 public:
  virtual ~ShardWriter() = default;  // without Finish: removes the .part
  // Adds samples first_row .. first_row + rows - 1 of a batch.
  virtual absl::Status Append(const Batch& batch, uint64_t first_row, uint64_t rows) = 0;
  // Syncs and renames into place.
  virtual absl::StatusOr<FinishedShard> Finish() = 0;
};

// `layout` must outlive the writer.
absl::StatusOr<std::unique_ptr<ShardWriter>> CreateShardWriter(const DatasetLayout& layout, uint64_t shard);
absl::StatusOr<std::unique_ptr<ShardWriter>> CreateWebDatasetWriter(const DatasetLayout& layout,
                                                                    uint64_t shard);
absl::StatusOr<std::unique_ptr<ShardWriter>> CreateFolderWriter(const DatasetLayout& layout, uint64_t shard);
absl::StatusOr<std::unique_ptr<ShardWriter>> CreateHdf5Writer(const DatasetLayout& layout, uint64_t shard);

// A shard that was written before, read from its bytes; the writers' Finish gives the same.
absl::StatusOr<FinishedShard> ReadFinishedShard(const DatasetLayout& layout, uint64_t shard);

// The lines that a folder's hash is taken of.
std::string FolderListing(const std::vector<std::pair<std::string, std::string>>& name_and_sha256);

}  // namespace touchstone::client
