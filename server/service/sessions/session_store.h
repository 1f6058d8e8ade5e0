// Measurement files and image sets by name, as touchstone.v1.Sessions keeps them: in a folder, so that replicas
// that share it have the same ones, or in memory. A name never changes its meaning. Every function may be
// called from several threads.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <absl/strings/string_view.h>

#include "server/service/options/server_options.h"
#include "server/service/sessions/stored_session.h"
#include "touchstone/v1/sessions.pb.h"

namespace touchstone::service {

class SessionStore {
 public:
  // options.sessions_dir and the limits on sessions.
  static absl::StatusOr<std::unique_ptr<SessionStore>> Open(const ServerOptions& options);

  // What comes in piece by piece counts towards the limits from the first piece on.
  class Upload {
   public:
    explicit Upload(SessionStore* store) : store_(store) {}
    ~Upload() { store_->uploading_ -= counted_; }
    Upload(const Upload&) = delete;
    Upload& operator=(const Upload&) = delete;
    // `file` as in CreateSessionRequest.
    absl::Status Append(const std::string& file, absl::string_view piece);
    // Of memory, to read what came so far: a second copy, and the pixels of pictures.
    uint64_t BytesToRead() const { return pieces_.bytes() + pieces_.PixelBytes(); }
    absl::StatusOr<std::string> Take() { return pieces_.Take(); }

   private:
    SessionStore* store_;
    uint64_t counted_ = 0;
    SessionPieces pieces_;
  };

  // [A-Za-z0-9_.-]{1,64}, no '.' first; the error names the field.
  static absl::Status CheckName(const std::string& name);
  const session::MeasurementLimits& limits() const { return limits_; }
  // Bytes are as in stored_session.h. The same bytes again are taken and change nothing; other bytes are ALREADY_EXISTS.
  absl::StatusOr<v1::Session> Create(const std::string& name, std::string bytes);
  absl::StatusOr<v1::Session> Find(const std::string& name);
  // By name, in the order of bytes; a file in the folder that is no session may be among them.
  std::vector<std::string> Names() const;
  absl::StatusOr<std::shared_ptr<const std::string>> Bytes(const std::string& name);
  // Hands the files over in pieces, until `take` returns false.
  absl::Status Export(const std::string& name,
                      const std::function<bool(const std::string& file, absl::string_view)>& take);
  absl::Status Delete(const std::string& name);

 private:
  // Which version of a file a description belongs to.
  struct Version {
    int64_t modified_ns = 0;
    uint64_t bytes = 0, inode = 0;
    bool operator==(const Version& other) const {
      return modified_ns == other.modified_ns && bytes == other.bytes && inode == other.inode;
    }
  };
  struct Usage {
    uint64_t sessions = 0, bytes = 0;
  };
  struct Known {
    v1::Session session;
    Version version;                           // with a folder
    std::shared_ptr<const std::string> bytes;  // without one
  };

  std::string PathOf(const std::string& name, bool images) const;
  // The file of a name, and which version of it; false: there is none.
  bool Stat(const std::string& name, Version* version, std::string* path = nullptr) const;
  Usage Stored() const;  // without a folder: with mutex_ held
  absl::Status NoSession(const std::string& name) const;
  absl::Status WriteNew(const std::string& name, const std::string& bytes) const;

  std::string folder_;
  session::MeasurementLimits limits_;
  uint64_t max_bytes_ = 0, max_bytes_together_ = 0;
  std::atomic<uint64_t> uploading_{0};
  mutable std::mutex mutex_;
  std::map<std::string, Known> known_;  // with a folder only a cache
};

}  // namespace touchstone::service
