#include "server/session/hdf5_file.h"

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "server/base/status.h"

namespace touchstone::session {
namespace {

constexpr uint64_t kMaxValues = uint64_t{1} << 31;  // of a dataset that is read

Hdf5Handle TextType(size_t bytes) {
  Hdf5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type, bytes);
  H5Tset_strpad(type, H5T_STR_NULLPAD);
  H5Tset_cset(type, H5T_CSET_UTF8);
  return type;
}

Hdf5Handle Create(const std::string& part) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // errors are ours to report
  Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_libver_bounds(access, H5F_LIBVER_V18, H5F_LIBVER_V18);
  // Times of objects would make other bytes of the same content; the root group keeps them unless told not to.
  Hdf5Handle creation(H5Pcreate(H5P_FILE_CREATE), H5Pclose);
  H5Pset_obj_track_times(creation, false);
  return Hdf5Handle(H5Fcreate(part.c_str(), H5F_ACC_TRUNC, creation, access), H5Fclose);
}

// The groups on the way to a dataset. Those that HDF5 makes by itself keep the time of their making.
void CreateGroupsOf(hid_t file, const std::string& name) {
  Hdf5Handle creation(H5Pcreate(H5P_GROUP_CREATE), H5Pclose);
  H5Pset_obj_track_times(creation, false);
  for (size_t slash = name.find('/', 1); slash != std::string::npos; slash = name.find('/', slash + 1)) {
    const std::string group = name.substr(0, slash);
    if (H5Lexists(file, group.c_str(), H5P_DEFAULT) > 0) continue;
    Hdf5Handle(H5Gcreate2(file, group.c_str(), H5P_DEFAULT, creation, H5P_DEFAULT), H5Gclose);
  }
}

// On the disk under its last name.
bool SyncAndRename(const std::string& from, const std::string& to) {
  const int descriptor = open(from.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return false;
  const bool synced = fsync(descriptor) == 0;
  close(descriptor);
  return synced && std::rename(from.c_str(), to.c_str()) == 0;
}

}  // namespace

Hdf5Columns::Hdf5Columns(const std::string& path) : path_(path), part_(path + ".part"), file_(Create(part_)) {
  if (!file_.ok()) failed_ = "the file";
}

Hdf5Columns::~Hdf5Columns() {
  file_.Close();
  if (!finished_) unlink(part_.c_str());
}

void Hdf5Columns::Write(const std::string& name, const std::string& unit, hid_t file_type, hid_t memory_type,
                        const void* values, const std::vector<hsize_t>& shape) {
  if (!failed_.empty()) return;
  CreateGroupsOf(file_, name);
  Hdf5Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_obj_track_times(creation, false);
  Hdf5Handle space(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr), H5Sclose);
  Hdf5Handle dataset(H5Dcreate2(file_, name.c_str(), file_type, space, H5P_DEFAULT, creation, H5P_DEFAULT),
                     H5Dclose);
  bool written = dataset.ok();
  const bool empty = std::find(shape.begin(), shape.end(), hsize_t{0}) != shape.end();
  if (written && !empty) written = H5Dwrite(dataset, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0;
  if (written && !unit.empty()) {
    const Hdf5Handle type = TextType(unit.size());
    Hdf5Handle scalar(H5Screate(H5S_SCALAR), H5Sclose);
    Hdf5Handle attribute(H5Acreate2(dataset, "unit", type, scalar, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    written = attribute.ok() && H5Awrite(attribute, type, unit.data()) >= 0;
  }
  if (!written) failed_ = absl::StrCat("dataset ", name);
}

void Hdf5Columns::Numbers(const std::string& name, const std::string& unit, const std::vector<double>& values,
                          std::vector<hsize_t> shape) {
  Write(name, unit, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, values.data(), shape);
}

void Hdf5Columns::Whole(const std::string& name, const std::vector<uint64_t>& values,
                        std::vector<hsize_t> shape) {
  Write(name, "", H5T_STD_U64LE, H5T_NATIVE_UINT64, values.data(), shape);
}

void Hdf5Columns::Texts(const std::string& name, const std::vector<std::string>& texts) {
  size_t longest = 1;
  for (const std::string& text : texts) longest = std::max(longest, text.size());
  std::string packed;
  for (const std::string& text : texts) packed += text + std::string(longest - text.size(), '\0');
  const Hdf5Handle type = TextType(longest);
  Write(name, "", type, type, packed.data(), {texts.size()});
}

void Hdf5Columns::Bytes(const std::string& name, const std::vector<std::string>& strings) {
  std::string bytes;
  std::vector<uint64_t> offsets = {0};
  for (const std::string& string : strings) {
    bytes += string;
    offsets.push_back(bytes.size());
  }
  Write(name, "", H5T_STD_U8LE, H5T_NATIVE_UINT8, bytes.data(), {bytes.size()});
  Whole(name + "_offset", offsets, {offsets.size()});
}

void Hdf5Columns::Pixels(const std::string& name, const std::vector<uint8_t>& values,
                         std::vector<hsize_t> shape) {
  Write(name, "", H5T_STD_U8LE, H5T_NATIVE_UINT8, values.data(), shape);
}

absl::Status Hdf5Columns::Finish() {
  if (failed_.empty() && !file_.Close()) failed_ = "the file";
  if (failed_.empty() && SyncAndRename(part_, path_)) {
    finished_ = true;
    return absl::OkStatus();
  }
  return absl::UnavailableError(
      absl::StrCat(path_, ": ", failed_.empty() ? "the file" : failed_,
                   " cannot be written (HDF5); check that its folder is there, may be "
                   "written and has room"));
}

absl::StatusOr<Hdf5ColumnsReader> Hdf5ColumnsReader::Open(const std::string& path) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  Hdf5Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!file.ok())
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": cannot be read as HDF5; name a file that 'session export' wrote"));
  return Hdf5ColumnsReader(path, std::move(file));
}

absl::Status Hdf5ColumnsReader::Wrong(const std::string& name, const std::string& what) const {
  return absl::InvalidArgumentError(
      absl::StrCat(path_, ": dataset ", name, " ", what, "; is this a file that 'session export' wrote?"));
}

absl::StatusOr<Hdf5Handle> Hdf5ColumnsReader::Dataset(const std::string& name, uint64_t* count) const {
  Hdf5Handle dataset(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), H5Dclose);
  if (!dataset.ok()) return Wrong(name, "is missing");
  Hdf5Handle space(H5Dget_space(dataset), H5Sclose);
  const hssize_t values = H5Sget_simple_extent_npoints(space);
  if (values < 0 || static_cast<uint64_t>(values) > kMaxValues)
    return Wrong(name, "is of no size that can be read");
  *count = static_cast<uint64_t>(values);
  return dataset;
}

bool Hdf5ColumnsReader::Has(const std::string& name) const {
  // H5Lexists asks for one step of the path only.
  for (size_t slash = name.find('/'); slash != std::string::npos; slash = name.find('/', slash + 1))
    if (H5Lexists(file_, name.substr(0, slash).c_str(), H5P_DEFAULT) <= 0) return false;
  return H5Lexists(file_, name.c_str(), H5P_DEFAULT) > 0;
}

absl::StatusOr<std::vector<double>> Hdf5ColumnsReader::Numbers(const std::string& name,
                                                               uint64_t count) const {
  uint64_t there = 0;
  TOUCHSTONE_ASSIGN_OR_RETURN(const Hdf5Handle dataset, Dataset(name, &there));
  if (there != count) return Wrong(name, absl::StrCat("has ", there, " values, not ", count));
  std::vector<double> values(count);
  if (count > 0 && H5Dread(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
    return Wrong(name, "cannot be read as numbers");
  return values;
}

absl::StatusOr<std::vector<uint64_t>> Hdf5ColumnsReader::Whole(const std::string& name,
                                                               uint64_t count) const {
  uint64_t there = 0;
  TOUCHSTONE_ASSIGN_OR_RETURN(const Hdf5Handle dataset, Dataset(name, &there));
  if (there != count) return Wrong(name, absl::StrCat("has ", there, " values, not ", count));
  std::vector<uint64_t> values(count);
  if (count > 0 && H5Dread(dataset, H5T_NATIVE_UINT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
    return Wrong(name, "cannot be read as whole numbers");
  return values;
}

absl::StatusOr<std::vector<std::string>> Hdf5ColumnsReader::Texts(const std::string& name,
                                                                  uint64_t count) const {
  uint64_t there = 0;
  TOUCHSTONE_ASSIGN_OR_RETURN(const Hdf5Handle dataset, Dataset(name, &there));
  if (there != count) return Wrong(name, absl::StrCat("has ", there, " values, not ", count));
  Hdf5Handle type(H5Dget_type(dataset), H5Tclose);
  const size_t bytes = H5Tget_size(type);
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) != 0 || bytes == 0 ||
      bytes * count > kMaxValues)
    return Wrong(name, "has no texts of fixed length");
  std::string packed(bytes * count, '\0');
  if (count > 0 && H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, packed.data()) < 0)
    return Wrong(name, "cannot be read as texts");
  std::vector<std::string> texts;
  for (uint64_t i = 0; i < count; ++i) {
    std::string text = packed.substr(i * bytes, bytes);
    text.erase(text.find_last_not_of('\0') + 1);
    texts.push_back(std::move(text));
  }
  return texts;
}

absl::StatusOr<std::vector<std::string>> Hdf5ColumnsReader::Bytes(const std::string& name,
                                                                  uint64_t count) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<uint64_t> offsets, Whole(name + "_offset", count + 1));
  uint64_t there = 0;
  TOUCHSTONE_ASSIGN_OR_RETURN(const Hdf5Handle dataset, Dataset(name, &there));
  if (offsets[0] != 0 || offsets[count] != there || !std::is_sorted(offsets.begin(), offsets.end()))
    return Wrong(name + "_offset", "does not cut the bytes in order");
  std::string bytes(there, '\0');
  if (there > 0 && H5Dread(dataset, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()) < 0)
    return Wrong(name, "cannot be read as bytes");
  std::vector<std::string> strings;
  for (uint64_t i = 0; i < count; ++i)
    strings.push_back(bytes.substr(offsets[i], offsets[i + 1] - offsets[i]));
  return strings;
}

absl::StatusOr<std::vector<uint8_t>> Hdf5ColumnsReader::Pixels(const std::string& name,
                                                               uint64_t count) const {
  uint64_t there = 0;
  TOUCHSTONE_ASSIGN_OR_RETURN(const Hdf5Handle dataset, Dataset(name, &there));
  if (there != count) return Wrong(name, absl::StrCat("has ", there, " values, not ", count));
  std::vector<uint8_t> values(count);
  if (count > 0 && H5Dread(dataset, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
    return Wrong(name, "cannot be read as pixels");
  return values;
}

}  // namespace touchstone::session
