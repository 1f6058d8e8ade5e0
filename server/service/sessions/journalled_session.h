// A session of a journal as the files that a server keeps of one: its measurement file, or, with photographs, the image
// set and touches.csv.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "server/service/sessions/stored_session.h"
#include "server/session/journal/journal.h"

namespace touchstone::service {

struct JournalledSession {
  StoredSession files;
  std::string left_out;  // why its photographs are not among them; empty: they are, or it has none
};

// Photographs that are no image set (session_images.h) are left out, which is said, where there are touches to go without
// them; else that is the error. DATA_LOSS names the touch or the picture that is damaged.
absl::StatusOr<JournalledSession> FilesOfJournal(const session::Journal& journal,
                                                 const session::JournalSession& session);

}  // namespace touchstone::service
