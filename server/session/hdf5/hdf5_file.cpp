#include "server/session/hdf5/hdf5_file.h"

#include <absl/strings/str_cat.h>
#include <unistd.h>

#include <algorithm>
#include <map>

#include "server/base/files/file_writer.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/session/hdf5/hdf5_checksums.h"

namespace touchstone::session {
namespace {

constexpr char kUnit[] = "unit";
// Values are hashed as they lie in memory, and stand in files in that order.
static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__);

Hdf5Handle TextType(size_t bytes) {
  Hdf5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type, bytes);
  H5Tset_strpad(type, H5T_STR_NULLPAD);
  H5Tset_cset(type, H5T_CSET_UTF8);
  return type;
}

bool WriteTextAttribute(hid_t object, const char* name, const std::string& text) {
  const Hdf5Handle type = TextType(text.size());
  const Hdf5Handle scalar(H5Screate(H5S_SCALAR), H5Sclose);
  const Hdf5Handle attribute(H5Acreate2(object, name, type, scalar, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  return attribute.ok() && H5Awrite(attribute, type, text.data()) >= 0;
}

// The groups on the way to a dataset. Those that HDF5 makes by itself keep the time of their making.
void CreateGroupsOf(hid_t file, const std::string& name) {
  const Hdf5Handle creation = WithoutTimes(H5P_GROUP_CREATE);
  for (size_t slash = name.find('/', 1); slash != std::string::npos; slash = name.find('/', slash + 1)) {
    const std::string group = name.substr(0, slash);
    if (H5Lexists(file, group.c_str(), H5P_DEFAULT) > 0) continue;
    Hdf5Handle(H5Gcreate2(file, group.c_str(), H5P_DEFAULT, creation, H5P_DEFAULT), H5Gclose);
  }
}

template <typename Value>
absl::string_view BytesOf(const std::vector<Value>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Value)};
}

// Piece by piece, so that pictures need not lie end to end in memory.
bool WriteValues(hid_t dataset, hid_t type, const std::vector<absl::string_view>& values,
                 const std::vector<hsize_t>& shape) {
  if (std::find(shape.begin(), shape.end(), hsize_t{0}) != shape.end()) return true;
  if (values.size() == 1)
    return H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values[0].data()) >= 0;
  const Hdf5Handle file_space(H5Dget_space(dataset), H5Sclose);
  hsize_t start = 0;
  for (const absl::string_view piece : values) {
    const hsize_t count = piece.size();
    if (count == 0) continue;
    const Hdf5Handle memory_space(H5Screate_simple(1, &count, nullptr), H5Sclose);
    if (H5Sselect_hyperslab(file_space, H5S_SELECT_SET, &start, nullptr, &count, nullptr) < 0 ||
        H5Dwrite(dataset, type, memory_space, file_space, H5P_DEFAULT, piece.data()) < 0)
      return false;
    start += count;
  }
  return true;
}

}  // namespace

Hdf5Columns::Hdf5Columns(const std::string& path) : path_(path), part_(UnfinishedPathOf(path)) {
  absl::StatusOr<std::unique_ptr<NewHdf5File>> file = NewHdf5File::Create(part_, path_);
  failed_ = file.status();
  if (!file.ok()) return;
  file_ = *std::move(file);
}

Hdf5Columns::~Hdf5Columns() = default;

void Hdf5Columns::Write(const std::string& name, const std::string& unit, hid_t type,
                        const std::vector<absl::string_view>& values, const std::vector<hsize_t>& shape) {
  if (!failed_.ok()) return;
  CreateGroupsOf(file_->id(), name);
  const Hdf5Handle creation = WithoutTimes(H5P_DATASET_CREATE);
  const Hdf5Handle space(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr), H5Sclose);
  const Hdf5Handle dataset(
      H5Dcreate2(file_->id(), name.c_str(), type, space, H5P_DEFAULT, creation, H5P_DEFAULT), H5Dclose);
  const std::string checksum = Sha256Hex(values);
  const bool written = dataset.ok() && WriteValues(dataset, type, values, shape) &&
                       (unit.empty() || WriteTextAttribute(dataset, kUnit, unit)) &&
                       WriteTextAttribute(dataset, kChecksum, checksum);
  checksums_[name] = checksum;
  if (!file_->written().ok())
    failed_ = file_->written();
  else if (!written)
    failed_ = absl::InternalError(absl::StrCat(path_, ": HDF5 cannot write dataset ", name));
}

void Hdf5Columns::Numbers(const std::string& name, const std::string& unit, const std::vector<double>& values,
                          std::vector<hsize_t> shape) {
  Write(name, unit, H5T_IEEE_F64LE, {BytesOf(values)}, shape);
}

void Hdf5Columns::Whole(const std::string& name, const std::vector<uint64_t>& values,
                        std::vector<hsize_t> shape) {
  Write(name, "", H5T_STD_U64LE, {BytesOf(values)}, shape);
}

void Hdf5Columns::Texts(const std::string& name, const std::vector<std::string>& texts) {
  size_t longest = 1;
  for (const std::string& text : texts) longest = std::max(longest, text.size());
  std::string packed;
  for (const std::string& text : texts) packed += text + std::string(longest - text.size(), '\0');
  Write(name, "", TextType(longest), {packed}, {texts.size()});
}

void Hdf5Columns::Bytes(const std::string& name, const std::vector<std::string>& strings) {
  std::vector<uint64_t> offsets = {0};
  for (const std::string& string : strings) offsets.push_back(offsets.back() + string.size());
  Write(name, "", H5T_STD_U8LE, {strings.begin(), strings.end()}, {offsets.back()});
  Whole(name + "_offset", offsets, {offsets.size()});
}

void Hdf5Columns::Pixels(const std::string& name, const std::vector<uint8_t>& values,
                         std::vector<hsize_t> shape) {
  Write(name, "", H5T_STD_U8LE, {BytesOf(values)}, shape);
}

absl::Status Hdf5Columns::Finish() {
  TOUCHSTONE_RETURN_IF_ERROR(failed_);
  {
    const Hdf5Handle root(H5Gopen2(file_->id(), "/", H5P_DEFAULT), H5Gclose);
    if (!WriteTextAttribute(root, kChecksums, ChecksumOfAll(checksums_)) && file_->written().ok())
      return absl::InternalError(absl::StrCat(path_, ": HDF5 cannot write an attribute"));
  }
  TOUCHSTONE_RETURN_IF_ERROR(file_->Finish());
  const absl::Status renamed = RenameSynced(part_, path_);
  if (!renamed.ok()) unlink(part_.c_str());
  return renamed;
}

}  // namespace touchstone::session
