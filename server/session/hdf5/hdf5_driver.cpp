#include "server/session/hdf5/hdf5_driver.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <vector>

#include "server/base/files/file_writer.h"
#include "server/base/status.h"

namespace touchstone::session {

class Hdf5Sink {
 public:
  explicit Hdf5Sink(std::unique_ptr<FileWriter> file) : file_(std::move(file)) {}

  void Write(uint64_t offset, absl::string_view data) {
    end_ = std::max(end_, offset + data.size());
    if (failed_.ok()) failed_ = file_->WriteAt(offset, data);
    if (!failed_.ok()) kept_.push_back({offset, std::string(data)});
  }

  void Read(uint64_t offset, char* bytes, size_t size) {
    if (const absl::Status read = file_->ReadAt(offset, bytes, size); failed_.ok()) failed_ = read;
    for (const Kept& kept : kept_) {
      const uint64_t from = std::max(offset, kept.offset);
      const uint64_t to = std::min(offset + size, kept.offset + kept.data.size());
      if (from < to) std::memcpy(bytes + (from - offset), kept.data.data() + (from - kept.offset), to - from);
    }
  }

  void Resize(uint64_t size) {
    if (size == end_) return;
    end_ = size;
    if (failed_.ok()) failed_ = file_->Resize(size);
  }

  uint64_t end() const { return end_; }
  const absl::Status& failed() const { return failed_; }
  absl::Status Close() { return failed_.ok() ? file_->Close() : failed_; }

 private:
  struct Kept {
    uint64_t offset;
    std::string data;
  };

  const std::unique_ptr<FileWriter> file_;  // removes itself unless it was closed
  uint64_t end_ = 0;
  absl::Status failed_;     // the first error
  std::vector<Kept> kept_;  // what came after it, in its order
};

namespace {

// The driver's own view of a file: HDF5's part first.
struct DriverFile {
  H5FD_t head;
  Hdf5Sink* sink;
  haddr_t end_of_addresses;
};
// What the property list of an access carries.
struct DriverInfo {
  Hdf5Sink* sink;
};

DriverFile* Of(H5FD_t* file) {
  return reinterpret_cast<DriverFile*>(file);
}
const DriverFile* Of(const H5FD_t* file) {
  return reinterpret_cast<const DriverFile*>(file);
}

H5FD_t* Open(const char*, unsigned, hid_t access, haddr_t) {
  const auto* info = static_cast<const DriverInfo*>(H5Pget_driver_info(access));
  if (info == nullptr) return nullptr;
  return &(new DriverFile{{}, info->sink, 0})->head;
}

herr_t Close(H5FD_t* file) {
  delete Of(file);
  return 0;
}

int Compare(const H5FD_t* a, const H5FD_t* b) {
  const Hdf5Sink *of_a = Of(a)->sink, *of_b = Of(b)->sink;
  return of_a < of_b ? -1 : of_a > of_b ? 1 : 0;
}

// As HDF5's own driver for files, so that equal content has the bytes that it gives it.
herr_t Query(const H5FD_t*, unsigned long* features) {
  *features = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_ACCUMULATE_METADATA | H5FD_FEAT_DATA_SIEVE |
              H5FD_FEAT_AGGREGATE_SMALLDATA | H5FD_FEAT_DEFAULT_VFD_COMPATIBLE;
  return 0;
}

haddr_t GetEndOfAddresses(const H5FD_t* file, H5FD_mem_t) {
  return Of(file)->end_of_addresses;
}

herr_t SetEndOfAddresses(H5FD_t* file, H5FD_mem_t, haddr_t end) {
  Of(file)->end_of_addresses = end;
  return 0;
}

haddr_t GetEndOfFile(const H5FD_t* file, H5FD_mem_t) {
  return Of(file)->sink->end();
}

herr_t Read(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t offset, size_t size, void* bytes) {
  Of(file)->sink->Read(offset, static_cast<char*>(bytes), size);
  return 0;
}

herr_t Write(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t offset, size_t size, const void* bytes) {
  Of(file)->sink->Write(offset, {static_cast<const char*>(bytes), size});
  return 0;
}

herr_t Truncate(H5FD_t* file, hid_t, hbool_t) {
  Of(file)->sink->Resize(Of(file)->end_of_addresses);
  return 0;
}

hid_t Driver() {
  static const H5FD_class_t kClass = [] {
    H5FD_class_t made;
    std::memset(&made, 0, sizeof made);
#ifdef H5FD_CLASS_VERSION
    made.version = H5FD_CLASS_VERSION;
    made.value = static_cast<H5FD_class_value_t>(600);  // of those that are for programs of their own
#endif
    made.name = "touchstone";
    made.maxaddr = std::numeric_limits<int64_t>::max();
    made.fc_degree = H5F_CLOSE_STRONG;
    made.fapl_size = sizeof(DriverInfo);
    made.open = Open;
    made.close = Close;
    made.cmp = Compare;
    made.query = Query;
    made.get_eoa = GetEndOfAddresses;
    made.set_eoa = SetEndOfAddresses;
    made.get_eof = GetEndOfFile;
    made.read = Read;
    made.write = Write;
    made.truncate = Truncate;
    const H5FD_mem_t map[] = H5FD_FLMAP_DICHOTOMY;
    std::copy(std::begin(map), std::end(map), made.fl_map);
    return made;
  }();
  static const hid_t driver = H5FDregister(&kClass);
  return driver;
}

}  // namespace

Hdf5Handle WithoutTimes(hid_t property_class) {
  Hdf5Handle properties(H5Pcreate(property_class), H5Pclose);
  H5Pset_obj_track_times(properties, false);
  return properties;
}

NewHdf5File::NewHdf5File(std::unique_ptr<Hdf5Sink> sink) : sink_(std::move(sink)) {}

NewHdf5File::~NewHdf5File() = default;

absl::StatusOr<std::unique_ptr<NewHdf5File>> NewHdf5File::Create(const std::string& path,
                                                                 const std::string& called) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // errors are ours to report
  TOUCHSTONE_ASSIGN_OR_RETURN(std::unique_ptr<FileWriter> writer, FileWriter::Create(path, 0666, called));
  std::unique_ptr<NewHdf5File> file(new NewHdf5File(std::make_unique<Hdf5Sink>(std::move(writer))));
  Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_libver_bounds(access, H5F_LIBVER_V18, H5F_LIBVER_V18);
  H5Pset_fclose_degree(access, H5F_CLOSE_STRONG);
  const DriverInfo info{file->sink_.get()};
  // The root group keeps times unless it is told not to.
  const Hdf5Handle creation = WithoutTimes(H5P_FILE_CREATE);
  if (H5Pset_driver(access, Driver(), &info) >= 0)
    file->file_ = Hdf5Handle(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, creation, access), H5Fclose);
  if (!file->file_.ok())
    return absl::InternalError(absl::StrCat(called.empty() ? path : called, ": HDF5 cannot make a file"));
  return file;
}

const absl::Status& NewHdf5File::written() const {
  return sink_->failed();
}

absl::Status NewHdf5File::Finish() {
  if (!file_.Close() && sink_->failed().ok()) return absl::InternalError("HDF5 cannot close a file");
  return sink_->Close();
}

}  // namespace touchstone::session
