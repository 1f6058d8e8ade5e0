// An HDF5 file as named columns of numbers and texts.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "server/session/hdf5/hdf5_driver.h"
#include "server/session/hdf5/hdf5_handle.h"

namespace touchstone::session {

// Writes datasets one after the other; names may have groups ("/images/png"). Each has a checksum of its values as attribute
// "sha256" (64 hexadecimal digits, of the bytes as they stand there), beside those that HDF5 keeps of all that is no
// values; the root's attribute "checksums" is that of all names and checksums. The first error is reported at the end. The file is whole or absent: it stands beside its place until Finish.
class Hdf5Columns {
 public:
  explicit Hdf5Columns(const std::string& path);
  ~Hdf5Columns();

  // `shape` multiplies to the number of values; the first dimension is the row.
  void Numbers(const std::string& name, const std::string& unit, const std::vector<double>& values,
               std::vector<hsize_t> shape);
  void Whole(const std::string& name, const std::vector<uint64_t>& values, std::vector<hsize_t> shape);
  void Texts(const std::string& name,
             const std::vector<std::string>& texts);  // without zero bytes at their ends
  // Byte strings end to end as `name`, and where each begins (one more than there are) as `name`_offset.
  void Bytes(const std::string& name, const std::vector<std::string>& strings);
  // 8-bit numbers of any shape: pictures.
  void Pixels(const std::string& name, const std::vector<uint8_t>& values, std::vector<hsize_t> shape);
  absl::Status Finish();

 private:
  // Values of one type, end to end; strings of their bytes one after the other.
  void Write(const std::string& name, const std::string& unit, hid_t type,
             const std::vector<absl::string_view>& values, const std::vector<hsize_t>& shape);

  const std::string path_, part_;
  std::unique_ptr<NewHdf5File> file_;
  absl::Status failed_;
  std::map<std::string, std::string> checksums_;  // by dataset
};

// Reads them again. Errors name the file and the dataset. Nothing is read from anywhere but this file: no link, virtual
// dataset, external storage or filter of others. What a dataset says of its size is held against the bytes that it has
// before there is memory for it. DATA_LOSS: the values are not those that were written.
class Hdf5ColumnsReader {
 public:
  static absl::StatusOr<Hdf5ColumnsReader> Open(const std::string& path);

  // `count` values, whatever their shape.
  bool Has(const std::string& name) const;
  absl::StatusOr<std::vector<double>> Numbers(const std::string& name, uint64_t count) const;
  absl::StatusOr<std::vector<uint64_t>> Whole(const std::string& name, uint64_t count) const;
  absl::StatusOr<std::vector<std::string>> Texts(const std::string& name, uint64_t count) const;
  absl::StatusOr<std::vector<std::string>> Bytes(const std::string& name, uint64_t count) const;
  absl::StatusOr<std::vector<uint8_t>> Pixels(const std::string& name, uint64_t count) const;

 private:
  struct Checked;
  Hdf5ColumnsReader(std::string path, Hdf5Handle file, bool has_checksums)
      : path_(std::move(path)), file_(std::move(file)), has_checksums_(has_checksums) {}
  bool IsLink(const std::string& name) const;
  absl::StatusOr<Checked> Dataset(const std::string& name) const;
  absl::StatusOr<Checked> Dataset(const std::string& name, uint64_t count) const;
  // Its values as `type`, and whether they are those that were written.
  absl::Status Read(const std::string& name, const Checked& dataset, hid_t type, size_t value_bytes,
                    void* values) const;
  absl::Status Wrong(const std::string& name, const std::string& what) const;

  std::string path_;
  Hdf5Handle file_;
  bool has_checksums_;  // files of earlier versions have none
};

}  // namespace touchstone::session
