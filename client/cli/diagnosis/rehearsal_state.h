// Rehearsed sets in a file, a line each, so that a rehearsal goes on where it was stopped. The first line says of what.
#pragma once

#include <string>
#include <vector>

#include "client/cli/diagnosis/rehearsal.h"

namespace touchstone::cli {

class RehearsalState {
 public:
  // Reads what there is; without a path nothing is kept. FAILED_PRECONDITION: it is of another rehearsal. DATA_LOSS names the
  // line that is none of a rehearsal; the last one, cut by what stopped it, is made again.
  static absl::StatusOr<RehearsalState> Open(const std::string& path, const Json& of);

  absl::Status Add(RehearsedSet set);
  const std::vector<RehearsedSet>& sets() const { return sets_; }

 private:
  // Whole, beside what it replaces: what was rehearsed before outlives a disk that fails and a kill.
  absl::Status Write() const;

  std::string path_, text_;  // where, and what stands there
  std::vector<RehearsedSet> sets_;
};

}  // namespace touchstone::cli
