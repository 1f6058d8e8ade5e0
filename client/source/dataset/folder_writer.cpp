// A shard as a folder that people can open: touches.csv (a measurement file, see proto/README.md, whose touch
// is the sample's index), one image file per sample named by its index, and one .npy over the whole shard for
// every other column.
#include <absl/strings/str_cat.h>

#include <filesystem>

#include "client/source/dataset/measurement_csv.h"
#include "client/source/dataset/npy.h"
#include "client/source/dataset/sample_text.h"
#include "client/source/dataset/shard_writer.h"
#include "client/source/dataset/synced_file.h"
#include "server/base/status.h"
#include "server/base/text/text.h"

namespace touchstone::client {
namespace {

// Columns whose numbers stand in touches.csv already.
bool StandsInCsv(const FileColumn& column, bool times_are_contact_times) {
  return IsPoseColumn(column) || column.wire_name == "index" || column.wire_name == "object" ||
         column.wire_name == (times_are_contact_times ? "contact_time_s" : "descriptor_s");
}

class FolderWriter : public ShardWriter {
 public:
  FolderWriter(const DatasetLayout& layout, uint64_t shard) : layout_(layout) {
    record_.name = layout.ShardName(shard);
    record_.first_index = layout.FirstIndex(shard);
    record_.samples = layout.SamplesIn(shard);
    path_ = layout.folder + "/" + record_.name;
    part_ = path_ + kPartSuffix;
  }

  ~FolderWriter() override {
    csv_.reset();
    arrays_.clear();
    std::error_code ignored;
    if (!finished_) std::filesystem::remove_all(part_, ignored);
  }

  absl::Status Open() {
    std::error_code error;
    std::filesystem::remove_all(part_, error);
    std::filesystem::create_directory(part_, error);
    if (error) return TellToResume(FileError(error.value(), part_, "cannot be made"));
    TOUCHSTONE_ASSIGN_OR_RETURN(csv_, SyncedFile::Create(part_ + "/touches.csv", Durability::kInFolder));
    TOUCHSTONE_RETURN_IF_ERROR(csv_->Write(session::MeasurementHeader(layout_.fingers, {})));
    const bool contact_times = layout_.FindColumn("contact_time_s") != nullptr;
    for (const FileColumn& column : layout_.columns) {
      std::unique_ptr<SyncedFile> file;
      if (column.type != v1::DATA_TYPE_BYTES && !StandsInCsv(column, contact_times)) {
        std::vector<uint64_t> shape = {record_.samples};
        shape.insert(shape.end(), column.shape.begin(), column.shape.end());
        TOUCHSTONE_ASSIGN_OR_RETURN(
            file, SyncedFile::Create(absl::StrCat(part_, "/", column.name, ".npy"), Durability::kInFolder));
        TOUCHSTONE_RETURN_IF_ERROR(file->Write(NpyHeader(column.type, shape)));
      }
      arrays_.push_back(std::move(file));
    }
    return absl::OkStatus();
  }

  absl::Status Append(const Batch& batch, uint64_t first_row, uint64_t rows) override {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<const v1::Column*> columns, MatchColumns(layout_, batch));
    for (uint64_t row = first_row; row < first_row + rows; ++row) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const std::string line, SampleMeasurementRow(layout_, batch, row));
      TOUCHSTONE_RETURN_IF_ERROR(csv_->Write(line));
    }
    for (size_t c = 0; c < columns.size(); ++c) {
      const FileColumn& column = layout_.columns[c];
      if (arrays_[c] != nullptr) {
        values_.clear();
        AppendLabValues(column, *columns[c], first_row, rows, &values_);
        TOUCHSTONE_RETURN_IF_ERROR(arrays_[c]->Write(values_));
      } else if (column.type == v1::DATA_TYPE_BYTES) {
        for (uint64_t row = first_row; row < first_row + rows; ++row)
          TOUCHSTONE_RETURN_IF_ERROR(AddImage(column, batch.start_index() + row, FileOf(*columns[c], row)));
      }
    }
    return absl::OkStatus();
  }

  absl::StatusOr<FinishedShard> Finish() override {
    TOUCHSTONE_RETURN_IF_ERROR(Commit(csv_.get(), "touches.csv"));
    for (size_t c = 0; c < arrays_.size(); ++c)
      if (arrays_[c] != nullptr)
        TOUCHSTONE_RETURN_IF_ERROR(Commit(arrays_[c].get(), layout_.columns[c].name + ".npy"));
    TOUCHSTONE_RETURN_IF_ERROR(SyncFileSystem(part_));
    TOUCHSTONE_RETURN_IF_ERROR(RenameUnfinished(part_, path_));
    finished_ = true;
    record_.sha256 = Sha256Hex(FolderListing(files_));
    return record_;
  }

 private:
  // 000123.png is the image; further encoded columns carry their name: 000123.mask.png.
  absl::Status AddImage(const FileColumn& column, uint64_t index, absl::string_view bytes) {
    const std::string name = absl::StrCat(layout_.Key(index), column.name == "image" ? "" : "." + column.name,
                                          ".", layout_.image_extension);
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::unique_ptr<SyncedFile> file,
                                SyncedFile::Create(part_ + "/" + name, Durability::kInFolder));
    TOUCHSTONE_RETURN_IF_ERROR(file->Write(bytes));
    return Commit(file.get(), name);
  }

  absl::Status Commit(SyncedFile* file, const std::string& name) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const FileDigest digest, file->Commit());
    record_.bytes += digest.bytes;
    files_.emplace_back(name, digest.sha256);
    return absl::OkStatus();
  }

  const DatasetLayout& layout_;
  FinishedShard record_;
  std::string path_;
  std::string part_;
  std::unique_ptr<SyncedFile> csv_;
  std::vector<std::unique_ptr<SyncedFile>> arrays_;         // by column; null where it stands elsewhere
  std::vector<std::pair<std::string, std::string>> files_;  // name, SHA-256
  std::string values_;
  bool finished_ = false;
};

}  // namespace

absl::StatusOr<std::unique_ptr<ShardWriter>> CreateFolderWriter(const DatasetLayout& layout, uint64_t shard) {
  auto writer = std::make_unique<FolderWriter>(layout, shard);
  TOUCHSTONE_RETURN_IF_ERROR(writer->Open());
  return writer;
}

}  // namespace touchstone::client
