// Reading of what hdf5_file.cpp wrote, and of what others may have made of it.
#include <absl/strings/str_cat.h>
#include <sys/stat.h>

#include <algorithm>
#include <map>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/session/hdf5/hdf5_checksums.h"
#include "server/session/hdf5/hdf5_file.h"

namespace touchstone::session {
namespace {

constexpr uint64_t kMaxValues = uint64_t{1} << 31;  // of a dataset that is read
constexpr uint64_t kMaxDeflation = 1032;            // of deflate: bytes that one byte can stand for

// "" if it is not there, or no text of fixed length.
std::string ReadTextAttribute(hid_t object, const char* name) {
  if (H5Aexists(object, name) <= 0) return "";
  const Hdf5Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose);
  const Hdf5Handle type(H5Aget_type(attribute), H5Tclose), space(H5Aget_space(attribute), H5Sclose);
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) != 0 ||
      H5Tget_size(type) != kChecksumDigits || H5Sget_simple_extent_npoints(space) != 1)
    return "";
  std::string text(kChecksumDigits, '\0');
  return H5Aread(attribute, type, text.data()) >= 0 ? text : "";
}

herr_t CollectName(hid_t, const char* name, const H5L_info_t* link, void* names) {
  if (link->type == H5L_TYPE_HARD) static_cast<std::vector<std::string>*>(names)->emplace_back(name);
  return 0;
}

// Of the datasets that have one; others are none of ours.
std::map<std::string, std::string> ChecksumsIn(hid_t file) {
  std::vector<std::string> names;
  std::map<std::string, std::string> checksums;
  H5Lvisit(file, H5_INDEX_NAME, H5_ITER_NATIVE, CollectName, &names);
  for (const std::string& name : names) {
    const Hdf5Handle object(H5Oopen(file, name.c_str(), H5P_DEFAULT), H5Oclose);
    if (!object.ok() || H5Iget_type(object) != H5I_DATASET) continue;
    std::string checksum = ReadTextAttribute(object, kChecksum);
    if (!checksum.empty()) checksums[name] = std::move(checksum);
  }
  return checksums;
}

}  // namespace

// A dataset all of whose bytes lie in this file.
struct Hdf5ColumnsReader::Checked {
  Hdf5Handle dataset{-1, H5Dclose}, type{-1, H5Tclose};
  uint64_t count = 0;
  std::string sha256;  // of its values; empty: the file has no checksums
};

absl::StatusOr<Hdf5ColumnsReader> Hdf5ColumnsReader::Open(const std::string& path) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  H5PLset_loading_state(0);  // no code of others for what a file may name
  struct stat facts {};
  // What is no file could be waited for without end.
  const bool is_file = stat(path.c_str(), &facts) == 0 && S_ISREG(facts.st_mode);
  Hdf5Handle file(is_file ? H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT) : -1, H5Fclose);
  if (!file.ok())
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": cannot be read as HDF5; name a file that 'session export' wrote"));
  const Hdf5Handle root(H5Gopen2(file, "/", H5P_DEFAULT), H5Gclose);
  const htri_t has_checksums = root.ok() ? H5Aexists(root, kChecksums) : -1;
  if (has_checksums < 0 ||
      (has_checksums > 0 && ReadTextAttribute(root, kChecksums) != ChecksumOfAll(ChecksumsIn(file))))
    return absl::DataLossError(absl::StrCat(path,
                                            ": is damaged or was changed: its datasets are not those that "
                                            "were written; export the session again"));
  return Hdf5ColumnsReader(path, std::move(file), has_checksums > 0);
}

absl::Status Hdf5ColumnsReader::Wrong(const std::string& name, const std::string& what) const {
  return absl::InvalidArgumentError(
      absl::StrCat(path_, ": dataset ", name, " ", what, "; is this a file that 'session export' wrote?"));
}

bool Hdf5ColumnsReader::Has(const std::string& name) const {
  // H5Lexists asks for one step of the path only.
  for (size_t slash = name.find('/'); slash != std::string::npos; slash = name.find('/', slash + 1))
    if (H5Lexists(file_, name.substr(0, slash).c_str(), H5P_DEFAULT) <= 0) return false;
  return H5Lexists(file_, name.c_str(), H5P_DEFAULT) > 0;
}

// A name, or one on the way to it, that leads elsewhere: to another name or another file.
bool Hdf5ColumnsReader::IsLink(const std::string& name) const {
  for (size_t end = name.find('/');; end = name.find('/', end + 1)) {
    H5L_info_t info;
    if (H5Lget_info(file_, name.substr(0, end).c_str(), &info, H5P_DEFAULT) < 0 || info.type != H5L_TYPE_HARD)
      return true;
    if (end == std::string::npos) return false;
  }
}

absl::StatusOr<Hdf5ColumnsReader::Checked> Hdf5ColumnsReader::Dataset(const std::string& name) const {
  if (!Has(name)) return Wrong(name, "is missing");
  if (IsLink(name)) return Wrong(name, "is a link to another place");
  Checked checked;
  checked.dataset = Hdf5Handle(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), H5Dclose);
  if (!checked.dataset.ok()) return Wrong(name, "cannot be opened");
  const Hdf5Handle creation(H5Dget_create_plist(checked.dataset), H5Pclose);
  const H5D_layout_t layout = H5Pget_layout(creation);
  if ((layout != H5D_CONTIGUOUS && layout != H5D_CHUNKED && layout != H5D_COMPACT) ||
      H5Pget_external_count(creation) != 0)
    return Wrong(name, "has its values in another file");
  const int filters = H5Pget_nfilters(creation);
  bool deflated = false;
  for (int k = 0; k < filters; ++k) {
    unsigned flags = 0;
    size_t parameters = 0;
    const H5Z_filter_t filter =
        H5Pget_filter2(creation, static_cast<unsigned>(k), &flags, &parameters, nullptr, 0, nullptr, nullptr);
    if (filter != H5Z_FILTER_DEFLATE && filter != H5Z_FILTER_SHUFFLE && filter != H5Z_FILTER_FLETCHER32)
      return Wrong(name, absl::StrCat("is stored through filter ", filter,
                                      "; deflate, shuffle and fletcher32 are read"));
    deflated = deflated || filter == H5Z_FILTER_DEFLATE;
  }
  const Hdf5Handle space(H5Dget_space(checked.dataset), H5Sclose);
  checked.type = Hdf5Handle(H5Dget_type(checked.dataset), H5Tclose);
  const hssize_t count = H5Sget_simple_extent_npoints(space);
  const uint64_t value_bytes = H5Tget_size(checked.type);
  if (count < 0 || static_cast<uint64_t>(count) > kMaxValues || value_bytes == 0 || value_bytes > kMaxValues)
    return Wrong(name, "is of no size that can be read");
  checked.count = static_cast<uint64_t>(count);
  // Values that were never written are made of nothing, as many as a file says.
  const uint64_t bytes = checked.count * value_bytes, stored = H5Dget_storage_size(checked.dataset);
  if (stored > kMaxValues * kMaxDeflation || bytes > stored * (deflated ? kMaxDeflation : 1))
    return Wrong(name, absl::StrCat("has ", stored, " bytes of ", bytes));
  checked.sha256 = ReadTextAttribute(checked.dataset, kChecksum);
  if (has_checksums_ && checked.sha256.empty()) return Wrong(name, "has no checksum");
  return checked;
}

absl::StatusOr<Hdf5ColumnsReader::Checked> Hdf5ColumnsReader::Dataset(const std::string& name,
                                                                      uint64_t count) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(Checked checked, Dataset(name));
  if (checked.count != count) return Wrong(name, absl::StrCat("has ", checked.count, " values, not ", count));
  return checked;
}

absl::Status Hdf5ColumnsReader::Read(const std::string& name, const Checked& dataset, hid_t type,
                                     size_t value_bytes, void* values) const {
  if (dataset.count > 0 && H5Dread(dataset.dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0)
    return Wrong(name, "cannot be read, or is of another type");
  const absl::string_view bytes(static_cast<const char*>(values), dataset.count * value_bytes);
  if (!has_checksums_ || Sha256Hex(bytes) == dataset.sha256) return absl::OkStatus();
  return absl::DataLossError(absl::StrCat(
      path_, ": dataset ", name,
      " is damaged or was changed: its values are not those of its checksum (attribute sha256); export the "
      "session again"));
}

absl::StatusOr<std::vector<double>> Hdf5ColumnsReader::Numbers(const std::string& name,
                                                               uint64_t count) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const Checked dataset, Dataset(name, count));
  std::vector<double> values(count);
  TOUCHSTONE_RETURN_IF_ERROR(Read(name, dataset, H5T_IEEE_F64LE, sizeof(double), values.data()));
  return values;
}

absl::StatusOr<std::vector<uint64_t>> Hdf5ColumnsReader::Whole(const std::string& name,
                                                               uint64_t count) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const Checked dataset, Dataset(name, count));
  if (H5Tget_class(dataset.type) != H5T_INTEGER) return Wrong(name, "has no whole numbers");
  std::vector<uint64_t> values(count);
  TOUCHSTONE_RETURN_IF_ERROR(Read(name, dataset, H5T_STD_U64LE, sizeof(uint64_t), values.data()));
  return values;
}

absl::StatusOr<std::vector<std::string>> Hdf5ColumnsReader::Texts(const std::string& name,
                                                                  uint64_t count) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const Checked dataset, Dataset(name, count));
  const size_t bytes = H5Tget_size(dataset.type);
  if (H5Tget_class(dataset.type) != H5T_STRING || H5Tis_variable_str(dataset.type) != 0)
    return Wrong(name, "has no texts of fixed length");
  std::string packed(bytes * count, '\0');
  TOUCHSTONE_RETURN_IF_ERROR(Read(name, dataset, dataset.type, bytes, packed.data()));
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
  TOUCHSTONE_ASSIGN_OR_RETURN(const Checked dataset, Dataset(name));
  if (offsets[0] != 0 || offsets[count] != dataset.count || !std::is_sorted(offsets.begin(), offsets.end()))
    return Wrong(name + "_offset", "does not cut the bytes in order");
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<uint8_t> bytes, Pixels(name, dataset.count));
  std::vector<std::string> strings;
  for (uint64_t i = 0; i < count; ++i)
    strings.emplace_back(bytes.begin() + offsets[i], bytes.begin() + offsets[i + 1]);
  return strings;
}

absl::StatusOr<std::vector<uint8_t>> Hdf5ColumnsReader::Pixels(const std::string& name,
                                                               uint64_t count) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const Checked dataset, Dataset(name, count));
  if (H5Tget_class(dataset.type) != H5T_INTEGER) return Wrong(name, "has no bytes");
  std::vector<uint8_t> values(count);
  TOUCHSTONE_RETURN_IF_ERROR(Read(name, dataset, H5T_STD_U8LE, 1, values.data()));
  return values;
}

}  // namespace touchstone::session
