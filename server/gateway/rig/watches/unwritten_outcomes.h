// What a rig has to write down and could not, because the journal's disk was full or failed: kept in memory until it is
// written. Nothing is told to a client as done before it is on the disk.
#pragma once

#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/status.h>

#include "server/session/journal/journal.h"

namespace touchstone::gateway {

// Thread-safe.
class UnwrittenOutcomes {
 public:
  using Facts = std::vector<std::pair<std::string, std::string>>;

  explicit UnwrittenOutcomes(session::Journal* journal) : journal_(journal) {}
  // Tries once more, and logs what is lost with this process.
  ~UnwrittenOutcomes();

  // The journal's Done and Failed. If the journal cannot be written, what became of the touch is kept; the error says
  // that it is, and to ask again under the same id.
  absl::Status Done(const std::string& session, const std::string& id, const session::JournalResult& result,
                    const session::JournalSeries* series = nullptr);
  absl::Status Failed(const std::string& session, const std::string& id, const std::string& error);
  // The journal's SetMetadata; `keep`: what cannot be written is kept. What was kept goes with it, in one step: that a motion
  // ended never reaches the disk without the latch that it closed. Whatever was kept for these keys is not written any more.
  absl::Status SetFacts(const Facts& facts, bool keep);

  // Writes what is kept, as far as it goes: facts, then outcomes. Before every motion, and now and then.
  void Flush();
  // OK unless the outcome of this touch is kept; then why it could not be written.
  absl::Status Kept(const std::string& session, const std::string& id) const;

 private:
  struct Outcome {
    std::string session, id;
    std::optional<session::JournalResult> result;  // none: it failed
    std::optional<session::JournalSeries> series;
    std::string error;
  };
  absl::Status Write(const Outcome& outcome);
  absl::Status WriteOrKeep(Outcome outcome);
  absl::Status WriteFacts(const Facts& facts);

  session::Journal* const journal_;
  mutable std::mutex mutex_;
  std::deque<Outcome> outcomes_;
  std::map<std::string, std::string> facts_;
};

}  // namespace touchstone::gateway
