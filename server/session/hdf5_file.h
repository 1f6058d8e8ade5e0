// HDF5 handles, and an HDF5 file as named columns of numbers and texts.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

namespace touchstone::session {

// An HDF5 handle with the function that closes it.
class Hdf5Handle {
 public:
  Hdf5Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  Hdf5Handle(Hdf5Handle&& other) noexcept : id_(other.id_), close_(other.close_) { other.id_ = -1; }
  Hdf5Handle& operator=(Hdf5Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }
  ~Hdf5Handle() { Close(); }
  bool ok() const { return id_ >= 0; }
  operator hid_t() const { return id_; }
  bool Close() {
    if (id_ < 0) return true;
    const bool closed = close_(id_) >= 0;
    id_ = -1;
    return closed;
  }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

// Writes datasets one after the other; names may have groups ("/images/png"). The first error is
// reported at the end. The file is whole or absent: it stands beside its place as NAME.part until Finish.
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
  void Write(const std::string& name, const std::string& unit, hid_t file_type, hid_t memory_type,
             const void* values, const std::vector<hsize_t>& shape);

  const std::string path_, part_;
  Hdf5Handle file_;
  std::string failed_;  // the dataset that could not be written
  bool finished_ = false;
};

// Reads them again. Errors name the file and the dataset.
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
  Hdf5ColumnsReader(std::string path, Hdf5Handle file) : path_(std::move(path)), file_(std::move(file)) {}
  absl::StatusOr<Hdf5Handle> Dataset(const std::string& name, uint64_t* count) const;
  absl::Status Wrong(const std::string& name, const std::string& what) const;

  std::string path_;
  Hdf5Handle file_;
};

}  // namespace touchstone::session
