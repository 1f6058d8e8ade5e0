// New HDF5 files that no failing disk can break. HDF5 1.10 ends in a segmentation fault, or says that all is well, after a
// write of its own that failed. Its writes therefore go through a driver (H5FD) that never tells it of one: it keeps what
// could not be written, so that HDF5 reads it back and closes its file as ever, and says at the end what went wrong.
#pragma once

#include <hdf5.h>

#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/session/hdf5/hdf5_handle.h"

namespace touchstone::session {

// What the driver writes to.
class Hdf5Sink;

class NewHdf5File {
 public:
  // Makes `path`, which must be free, for HDF5 1.8 and later, without times of its own: equal content has equal bytes.
  // `called`: its name in messages, if not `path`. RESOURCE_EXHAUSTED: no room.
  static absl::StatusOr<std::unique_ptr<NewHdf5File>> Create(const std::string& path,
                                                             const std::string& called = "");
  // Without Finish: removes the file.
  ~NewHdf5File();

  hid_t id() const { return file_; }
  // What could not be written so far.
  const absl::Status& written() const;
  // Closes whatever is open in it, and syncs. An error: the file is gone.
  absl::Status Finish();

 private:
  explicit NewHdf5File(std::unique_ptr<Hdf5Sink> sink);

  std::unique_ptr<Hdf5Sink> sink_;
  Hdf5Handle file_{-1, H5Fclose};
};

// A property list, or a dataset's parts, that keep no times: those would make other bytes of the same content.
Hdf5Handle WithoutTimes(hid_t property_class);

}  // namespace touchstone::session
