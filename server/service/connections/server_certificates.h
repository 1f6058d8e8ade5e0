// The files of a server's certificate, read again when they change. What does not hold together, as while one of them has
// been written and the other not yet, is not taken: what was there before goes on serving.
#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include <absl/status/statusor.h>

#include "server/service/connections/file_stamp.h"

namespace touchstone::service {

struct CertificateTexts {  // PEM
  std::string certificate, key, client_ca;
};

// Safe for use by many threads.
class ServerCertificates {
 public:
  // `client_ca` may be empty. Errors name the file: it cannot be read, is no PEM, the key is another one's.
  static absl::StatusOr<std::unique_ptr<ServerCertificates>> Read(const std::string& certificate,
                                                                  const std::string& key,
                                                                  const std::string& client_ca);

  // The texts, if they have not been taken yet; reads files that changed.
  std::optional<CertificateTexts> TakeIfNew();
  bool asks_clients() const { return !paths_[2].empty(); }

 private:
  explicit ServerCertificates(std::array<std::string, 3> paths) : paths_(std::move(paths)) {}
  std::array<FileStamp, 3> Stamps() const;
  absl::Status Load();

  const std::array<std::string, 3> paths_;  // certificate, key, client CA
  std::mutex mutex_;
  std::array<FileStamp, 3> stamps_;  // of what was read last, good or not
  CertificateTexts texts_;
  bool taken_ = false;
};

}  // namespace touchstone::service
