// What `touchstone session list` and `show` print: sessions of a server and of a journal.
#pragma once

#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "client/cli/common/common.h"
#include "client/cli/session/journal_session.h"

namespace touchstone::cli {

struct SessionOptions : SessionPlace {
  std::string file, output;
  bool check = false;
  bool deleted = false, skip_damaged = false;
};

// INVALID_ARGUMENT without --server.
absl::StatusOr<std::unique_ptr<client::Connection>> ConnectToServer(const Cli& cli);

// "960 touches, 3 fingers, hash 0123456789ab"
std::string InWords(const v1::Session& session);
Json SessionJson(const v1::Session& session);

// What is read without checksums cannot be told from what has changed on the disk.
void SayIfUnchecked(const Cli& cli, const session::Journal& journal, const std::string& path);

// `options.file`: a journal; "": the sessions of --server.
absl::Status RunList(const Cli& cli, const SessionOptions& options);
absl::Status RunShow(const Cli& cli, const SessionOptions& options);

}  // namespace touchstone::cli
