#include "client/source/dataset/shard_writer.h"

#include <absl/strings/str_cat.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>

#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::client {
namespace {

constexpr size_t kMinKeyDigits = 6;
constexpr size_t kShardDigits = 6;

std::string Padded(uint64_t number, size_t digits) {
  std::string text = std::to_string(number);
  if (text.size() < digits) text.insert(0, digits - text.size(), '0');
  return text;
}

const char* Extension(ShardFormat format) {
  switch (format) {
    case ShardFormat::kWebDataset:
      return ".tar";
    case ShardFormat::kHdf5:
      return ".h5";
    case ShardFormat::kFolder:
      return "";
  }
  return "";
}

}  // namespace

const char* ShardFormatName(ShardFormat format) {
  switch (format) {
    case ShardFormat::kWebDataset:
      return "webdataset";
    case ShardFormat::kFolder:
      return "folder";
    case ShardFormat::kHdf5:
      return "hdf5";
  }
  return "";
}

absl::StatusOr<ShardFormat> ParseShardFormat(const std::string& name) {
  for (const ShardFormat format : {ShardFormat::kWebDataset, ShardFormat::kFolder, ShardFormat::kHdf5})
    if (name == ShardFormatName(format)) return format;
  return absl::InvalidArgumentError(
      absl::StrCat("--to: unknown format '", name, "'", DidYouMean(name, {"webdataset", "folder", "hdf5"})));
}

uint64_t DatasetLayout::SamplesIn(uint64_t shard) const {
  return std::min(shard_size, samples - FirstIndex(shard));
}

std::string DatasetLayout::ShardName(uint64_t shard) const {
  return absl::StrCat("shard-", Padded(shard, kShardDigits), Extension(format));
}

std::string DatasetLayout::Key(uint64_t index) const {
  const size_t digits = samples == 0 ? 1 : std::to_string(samples - 1).size();
  return Padded(index, std::max(digits, kMinKeyDigits));
}

const FileColumn* DatasetLayout::FindColumn(const std::string& wire_name) const {
  for (const FileColumn& column : columns)
    if (column.wire_name == wire_name) return &column;
  return nullptr;
}

absl::StatusOr<std::unique_ptr<ShardWriter>> CreateShardWriter(const DatasetLayout& layout, uint64_t shard) {
  switch (layout.format) {
    case ShardFormat::kWebDataset:
      return CreateWebDatasetWriter(layout, shard);
    case ShardFormat::kFolder:
      return CreateFolderWriter(layout, shard);
    case ShardFormat::kHdf5:
      return CreateHdf5Writer(layout, shard);
  }
  return absl::InternalError("unknown shard format");
}

std::string FolderListing(const std::vector<std::pair<std::string, std::string>>& name_and_sha256) {
  auto sorted = name_and_sha256;
  std::sort(sorted.begin(), sorted.end());
  std::string listing;
  for (const auto& [name, sha256] : sorted) absl::StrAppend(&listing, sha256, "  ", name, "\n");
  return listing;
}

absl::StatusOr<FinishedShard> ReadFinishedShard(const DatasetLayout& layout, uint64_t shard) {
  FinishedShard finished;
  finished.name = layout.ShardName(shard);
  finished.first_index = layout.FirstIndex(shard);
  finished.samples = layout.SamplesIn(shard);
  const std::filesystem::path path = std::filesystem::path(layout.folder) / finished.name;
  std::error_code error;
  if (layout.format != ShardFormat::kFolder) {
    finished.bytes = std::filesystem::file_size(path, error);
    if (error) return absl::NotFoundError(absl::StrCat(path.string(), ": ", error.message()));
    TOUCHSTONE_ASSIGN_OR_RETURN(finished.sha256, Sha256HexOfFile(path.string()));
    return finished;
  }
  std::vector<std::pair<std::string, std::string>> files;
  for (std::filesystem::directory_iterator entry(path, error), end; !error && entry != end;
       entry.increment(error)) {
    TOUCHSTONE_ASSIGN_OR_RETURN(std::string sha256, Sha256HexOfFile(entry->path().string()));
    finished.bytes += std::filesystem::file_size(entry->path(), error);
    files.emplace_back(entry->path().filename().string(), std::move(sha256));
  }
  if (error) return absl::NotFoundError(absl::StrCat(path.string(), ": ", error.message()));
  finished.sha256 = Sha256Hex(FolderListing(files));
  return finished;
}

}  // namespace touchstone::client
