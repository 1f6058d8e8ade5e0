// The local record of a run: a session in a journal on this computer that has every touch which the source
// has done, under the same ids. What it holds is not asked for again.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "client/source/dataset/measurement_csv.h"
#include "server/session/journal/journal.h"
#include "touchstone/v1/rig.pb.h"
#include "touchstone/v1/types.pb.h"

namespace touchstone::cli {

class RigRecord {
 public:
  // Opens or makes the journal and its session.
  static absl::StatusOr<std::unique_ptr<RigRecord>> Open(const std::string& path, const std::string& session,
                                                         const v1::RigState& rig);

  // Whether the touch is recorded already; ALREADY_EXISTS if its id stands for another one there.
  absl::StatusOr<bool> Has(const std::string& id, const client::MeasuredTouch& touch) const;
  // Before the touch is asked for.
  absl::Status Begin(const std::string& id, const client::MeasuredTouch& touch, const std::string& up_face);
  // Its result; on the disk when this returns.
  absl::Status Done(const std::string& id, const v1::TouchResult& result);
  absl::Status Failed(const std::string& id, const absl::Status& why);

  // All that are done, in the order in which they were made.
  absl::StatusOr<std::vector<client::MeasuredTouch>> Touches() const;

  session::Journal& journal() { return *journal_; }

 private:
  std::unique_ptr<session::Journal> journal_;
  std::string session_;
};

// A result as the journal keeps it.
session::JournalResult ResultOfMessage(const v1::TouchResult& message);

// Checks that the path ends in .db (a journal) or .csv (a measurement file, with the journal beside it) and
// gives the journal's path: "set.csv" -> "set.db".
absl::StatusOr<std::string> JournalPathOf(const std::string& output);

}  // namespace touchstone::cli
