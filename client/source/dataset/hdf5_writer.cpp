// A shard as one HDF5 file: a chunked dataset a column, its first dimension the sample, with the attribute
// "unit"; the root's attributes name the objects. No time stamps, so the same samples give the same bytes.
#include <absl/strings/str_cat.h>
#include <hdf5.h>
#include <unistd.h>

#include <filesystem>

#include "client/source/dataset/sample_text.h"
#include "client/source/dataset/shard_writer.h"
#include "client/source/dataset/synced_file.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/session/hdf5/hdf5_driver.h"

namespace touchstone::client {
namespace {

constexpr uint64_t kChunkBytes = 64 << 10;
constexpr unsigned kImageDeflateLevel = 1;

using Handle = session::Hdf5Handle;

hid_t Hdf5Type(v1::DataType type) {
  switch (type) {
    case v1::DATA_TYPE_FLOAT32:
      return H5T_IEEE_F32LE;
    case v1::DATA_TYPE_FLOAT64:
      return H5T_IEEE_F64LE;
    case v1::DATA_TYPE_UINT8:
      return H5T_STD_U8LE;
    case v1::DATA_TYPE_INT32:
      return H5T_STD_I32LE;
    case v1::DATA_TYPE_UINT64:
      return H5T_STD_U64LE;
    default:
      return -1;
  }
}

// Attribute `name` with one or several fixed-length UTF-8 texts.
bool WriteTexts(hid_t object, const char* name, const std::vector<std::string>& texts, bool scalar) {
  size_t longest = 1;
  for (const std::string& text : texts) longest = std::max(longest, text.size());
  std::string packed;
  for (const std::string& text : texts) packed += text + std::string(longest - text.size(), '\0');
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type, longest);
  H5Tset_strpad(type, H5T_STR_NULLPAD);
  H5Tset_cset(type, H5T_CSET_UTF8);
  const hsize_t count = texts.size();
  Handle space(scalar ? H5Screate(H5S_SCALAR) : H5Screate_simple(1, &count, nullptr), H5Sclose);
  Handle attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  return attribute.ok() && H5Awrite(attribute, type, packed.data()) >= 0;
}

class Hdf5Writer : public ShardWriter {
 public:
  Hdf5Writer(const DatasetLayout& layout, uint64_t shard)
      : layout_(layout), path_(layout.folder + "/" + layout.ShardName(shard)), part_(path_ + kPartSuffix) {
    record_.name = layout.ShardName(shard);
    record_.first_index = layout.FirstIndex(shard);
    record_.samples = layout.SamplesIn(shard);
  }

  ~Hdf5Writer() override { datasets_.clear(); }

  absl::Status Open() {
    ::unlink(part_.c_str());  // of a run that was killed
    absl::StatusOr<std::unique_ptr<session::NewHdf5File>> file = session::NewHdf5File::Create(part_, path_);
    if (!file.ok()) return TellToResume(file.status());
    file_ = *std::move(file);
    const Handle root(H5Gopen2(file_->id(), "/", H5P_DEFAULT), H5Gclose);
    if (!WriteTexts(root, "objects", layout_.objects, false)) return Failed("an attribute cannot be written");
    for (const FileColumn& column : layout_.columns) TOUCHSTONE_RETURN_IF_ERROR(AddDataset(column));
    return absl::OkStatus();
  }

  absl::Status Append(const Batch& batch, uint64_t first_row, uint64_t rows) override {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<const v1::Column*> columns, MatchColumns(layout_, batch));
    for (size_t c = 0; c < columns.size(); ++c) {
      const FileColumn& column = layout_.columns[c];
      values_.clear();
      AppendLabValues(column, *columns[c], first_row, rows, &values_);
      std::vector<hsize_t> start(1 + column.shape.size(), 0), count = {rows};
      start[0] = written_;
      count.insert(count.end(), column.shape.begin(), column.shape.end());
      Handle memory(H5Screate_simple(static_cast<int>(count.size()), count.data(), nullptr), H5Sclose);
      Handle space(H5Dget_space(datasets_[c]), H5Sclose);
      H5Sselect_hyperslab(space, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
      if (H5Dwrite(datasets_[c], Hdf5Type(column.type), memory, space, H5P_DEFAULT, values_.data()) < 0)
        return Failed("writing failed");
      TOUCHSTONE_RETURN_IF_ERROR(TellToResume(file_->written()));
    }
    written_ += rows;
    return absl::OkStatus();
  }

  absl::StatusOr<FinishedShard> Finish() override {
    bool closed = true;
    for (Handle& dataset : datasets_) closed = dataset.Close() && closed;
    TOUCHSTONE_RETURN_IF_ERROR(TellToResume(file_->Finish()));
    const absl::StatusOr<std::string> sha256 = closed ? Sha256HexOfFile(part_) : Failed("closing failed");
    std::error_code error;
    record_.bytes = std::filesystem::file_size(part_, error);
    if (!sha256.ok() || error) {
      ::unlink(part_.c_str());
      return sha256.ok() ? FileError(error.value(), path_, "cannot be examined") : sha256.status();
    }
    record_.sha256 = *sha256;
    TOUCHSTONE_RETURN_IF_ERROR(RenameUnfinished(part_, path_));
    return record_;
  }

 private:
  absl::Status AddDataset(const FileColumn& column) {
    const hid_t type = Hdf5Type(column.type);
    if (type < 0)
      return absl::InvalidArgumentError(absl::StrCat("HDF5 holds pixels, not PNG or JPEG files: column '",
                                                     column.name, "' needs --encoding raw"));
    std::vector<hsize_t> size = {record_.samples};
    size.insert(size.end(), column.shape.begin(), column.shape.end());
    // One image a chunk, so that a random sample is one read; a few thousand rows of small columns.
    const uint64_t sample_bytes = std::max<uint64_t>(1, column.Values() * BytesPerValue(column.type));
    std::vector<hsize_t> chunk = size;
    chunk[0] = std::clamp<uint64_t>(kChunkBytes / sample_bytes, 1, record_.samples);
    const Handle creation = session::WithoutTimes(H5P_DATASET_CREATE);
    H5Pset_chunk(creation, static_cast<int>(chunk.size()), chunk.data());
    if (column.shape.size() >= 2) H5Pset_deflate(creation, kImageDeflateLevel);
    Handle space(H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr), H5Sclose);
    Handle dataset(
        H5Dcreate2(file_->id(), column.name.c_str(), type, space, H5P_DEFAULT, creation, H5P_DEFAULT),
        H5Dclose);
    if (!dataset.ok()) return Failed("a dataset cannot be made");
    if (!WriteTexts(dataset, "unit", {std::string(UnitSymbol(column.unit))}, true))
      return Failed("an attribute cannot be written");
    datasets_.push_back(std::move(dataset));
    return absl::OkStatus();
  }

  absl::Status Failed(const char* what) const {
    if (!file_->written().ok()) return TellToResume(file_->written());
    return absl::InternalError(absl::StrCat(path_, ": ", what, " (HDF5)"));
  }

  const DatasetLayout& layout_;
  std::string path_;
  std::string part_;
  FinishedShard record_;
  std::unique_ptr<session::NewHdf5File> file_;
  std::vector<Handle> datasets_;
  uint64_t written_ = 0;
  std::string values_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<ShardWriter>> CreateHdf5Writer(const DatasetLayout& layout, uint64_t shard) {
  auto writer = std::make_unique<Hdf5Writer>(layout, shard);
  TOUCHSTONE_RETURN_IF_ERROR(writer->Open());
  return writer;
}

}  // namespace touchstone::client
