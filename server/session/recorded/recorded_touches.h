// What was recorded, to be given again: every touch of a journal that is done, by object and command.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include <absl/status/statusor.h>

#include "server/session/journal/journal.h"
#include "touchstone/v1/types.pb.h"

namespace touchstone::session {

// Unchanged after it was made; any thread may read.
class RecordedTouches {
 public:
  // Of these sessions; all of the journal if none is named. INVALID_ARGUMENT if their fingers or spacings
  // differ, or if nothing was recorded. With `failed_too` also what failed, and it is no error if there is nothing.
  static absl::StatusOr<std::unique_ptr<RecordedTouches>> Read(const Journal& journal,
                                                               const std::vector<std::string>& sessions = {},
                                                               bool failed_too = false);

  // In order of appearance.
  const std::vector<std::string>& objects() const { return objects_; }
  int fingers() const { return fingers_; }
  double spacing_m() const { return spacing_m_; }
  // In the order in which they were made, session after session.
  const std::vector<JournalTouch>& touches() const { return touches_; }

  // The touch of that id (the last one, if several sessions have it); null: none.
  const JournalTouch* FindId(const std::string& id) const;

  // The repeats of a command in the order in which they were made, and round again: number `repeat` of them.
  // The same bytes first; else the first command whose pose, speed and stroke differ by 1e-9 (SI) at most,
  // whatever its session time and covariates. Null: never recorded.
  const JournalTouch* Find(const std::string& object, const v1::CommandedTouch& command,
                           uint64_t repeat = 0) const;
  const JournalTouch* Find(const std::string& object, const std::string& command_bytes,
                           uint64_t repeat = 0) const;
  // How many repeats Find goes through.
  size_t Repeats(const std::string& object, const v1::CommandedTouch& command) const;

 private:
  using Rows = std::vector<uint32_t>;
  // A command that was recorded, its pose known to the nearest step of a grid.
  struct Recorded {
    v1::CommandedTouch command;
    Rows rows;
  };

  void Add(JournalTouch touch);
  const Rows* FindRows(const std::string& object, const std::string& bytes,
                       const v1::CommandedTouch& command) const;

  int fingers_ = 0;
  double spacing_m_ = 0;
  std::vector<std::string> objects_;
  std::vector<JournalTouch> touches_;
  std::unordered_map<std::string, uint32_t> by_id_;
  std::unordered_map<std::string, Rows> by_bytes_;                  // object, zero byte, canonical bytes
  std::unordered_map<std::string, std::vector<Recorded>> by_cell_;  // object and cell of the target
};

}  // namespace touchstone::session
