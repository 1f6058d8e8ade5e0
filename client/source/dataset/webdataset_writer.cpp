// WebDataset shards: a POSIX tar in which the members of one sample stand together under one key,
// KEY.descriptor_us.npy, KEY.image.png, KEY.json. Owner, mode and time of every member are fixed.
#include <absl/strings/str_cat.h>
#include <archive.h>
#include <archive_entry.h>

#include <filesystem>

#include "client/source/dataset/npy.h"
#include "client/source/dataset/sample_text.h"
#include "client/source/dataset/shard_writer.h"
#include "client/source/dataset/synced_file.h"
#include "server/base/status.h"

namespace touchstone::client {
namespace {

class WebDatasetWriter : public ShardWriter {
 public:
  WebDatasetWriter(const DatasetLayout& layout, uint64_t shard) : layout_(layout) {
    record_.name = layout.ShardName(shard);
    record_.first_index = layout.FirstIndex(shard);
    record_.samples = layout.SamplesIn(shard);
  }

  ~WebDatasetWriter() override {
    // Freeing an unfinished archive would still write its end; the callback then drops it.
    abandoned_ = true;
    if (archive_ != nullptr) archive_write_free(archive_);
    if (entry_ != nullptr) archive_entry_free(entry_);
  }

  absl::Status Open() {
    TOUCHSTONE_ASSIGN_OR_RETURN(file_, SyncedFile::Create(layout_.folder + "/" + record_.name));
    archive_ = archive_write_new();
    entry_ = archive_entry_new();
    archive_write_set_format_ustar(archive_);
    archive_write_set_bytes_per_block(archive_, 0);  // SyncedFile buffers
    archive_write_set_bytes_in_last_block(archive_, 1);
    if (archive_write_open(archive_, this, nullptr, &WebDatasetWriter::WriteBlock, nullptr) != ARCHIVE_OK)
      return ArchiveError();
    for (const FileColumn& column : layout_.columns)
      npy_headers_.push_back(NumpyType(column.type).empty() ? "" : NpyHeader(column.type, column.shape));
    return absl::OkStatus();
  }

  absl::Status Append(const Batch& batch, uint64_t first_row, uint64_t rows) override {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<const v1::Column*> columns, MatchColumns(layout_, batch));
    for (uint64_t row = first_row; row < first_row + rows; ++row) {
      const std::string key = layout_.Key(batch.start_index() + row);
      for (size_t c = 0; c < columns.size(); ++c) {
        const FileColumn& column = layout_.columns[c];
        if (column.type == v1::DATA_TYPE_BYTES) {
          TOUCHSTONE_RETURN_IF_ERROR(AddMember(
              absl::StrCat(key, ".", column.name, ".", layout_.image_extension), FileOf(*columns[c], row)));
        } else if (!column.shape.empty() && !IsPoseColumn(column)) {
          member_ = npy_headers_[c];
          AppendLabValues(column, *columns[c], row, 1, &member_);
          TOUCHSTONE_RETURN_IF_ERROR(AddMember(absl::StrCat(key, ".", column.name, ".npy"), member_));
        }
      }
      TOUCHSTONE_ASSIGN_OR_RETURN(const std::string json, SampleJson(layout_, batch, row));
      TOUCHSTONE_RETURN_IF_ERROR(AddMember(key + ".json", json));
    }
    return absl::OkStatus();
  }

  absl::StatusOr<FinishedShard> Finish() override {
    if (archive_write_close(archive_) != ARCHIVE_OK) return ArchiveError();
    TOUCHSTONE_ASSIGN_OR_RETURN(const FileDigest file, file_->Commit());
    record_.bytes = file.bytes;
    record_.sha256 = file.sha256;
    return record_;
  }

 private:
  static la_ssize_t WriteBlock(archive* archive, void* self, const void* data, size_t size) {
    auto* writer = static_cast<WebDatasetWriter*>(self);
    if (writer->abandoned_) return static_cast<la_ssize_t>(size);
    writer->write_status_ = writer->file_->Write(absl::string_view(static_cast<const char*>(data), size));
    if (writer->write_status_.ok()) return static_cast<la_ssize_t>(size);
    archive_set_error(archive, EIO, "%s", "writing failed");
    return -1;
  }

  absl::Status AddMember(const std::string& name, absl::string_view data) {
    archive_entry_clear(entry_);
    archive_entry_set_pathname(entry_, name.c_str());
    archive_entry_set_size(entry_, static_cast<la_int64_t>(data.size()));
    archive_entry_set_filetype(entry_, AE_IFREG);
    archive_entry_set_perm(entry_, 0644);
    archive_entry_set_mtime(entry_, 0, 0);
    archive_entry_set_uid(entry_, 0);
    archive_entry_set_gid(entry_, 0);
    if (archive_write_header(archive_, entry_) != ARCHIVE_OK) return ArchiveError();
    if (archive_write_data(archive_, data.data(), data.size()) != static_cast<la_ssize_t>(data.size()))
      return ArchiveError();
    return absl::OkStatus();
  }

  // What our own callback found says more than libarchive's text.
  absl::Status ArchiveError() const {
    if (!write_status_.ok()) return write_status_;
    const char* text = archive_error_string(archive_);
    return absl::InternalError(
        absl::StrCat(record_.name, ": ", text == nullptr ? "unknown error of libarchive" : text));
  }

  const DatasetLayout& layout_;
  FinishedShard record_;
  std::unique_ptr<SyncedFile> file_;
  archive* archive_ = nullptr;
  archive_entry* entry_ = nullptr;
  absl::Status write_status_;
  bool abandoned_ = false;
  std::vector<std::string> npy_headers_;  // by column; empty where it is no array
  std::string member_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<ShardWriter>> CreateWebDatasetWriter(const DatasetLayout& layout,
                                                                    uint64_t shard) {
  auto writer = std::make_unique<WebDatasetWriter>(layout, shard);
  TOUCHSTONE_RETURN_IF_ERROR(writer->Open());
  return writer;
}

}  // namespace touchstone::client
