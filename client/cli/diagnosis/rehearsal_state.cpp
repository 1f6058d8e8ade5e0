#include "client/cli/diagnosis/rehearsal_state.h"

#include <absl/strings/str_cat.h>

#include <fstream>
#include <utility>

#include "server/base/files/file_writer.h"
#include "server/base/status.h"

namespace touchstone::cli {

absl::StatusOr<RehearsalState> RehearsalState::Open(const std::string& path, const Json& of) {
  RehearsalState state;
  state.path_ = path;
  if (path.empty()) return state;
  std::ifstream file(path);
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    const Json json = Json::parse(line, nullptr, /*allow_exceptions=*/false);
    if (number == 1) {
      if (json != of)
        return absl::FailedPreconditionError(
            absl::StrCat("--state: ", path,
                         " is of another plan, model, seed or size; another file, or none, was expected"));
      continue;
    }
    if (json.is_discarded() && file.peek() == EOF) break;  // cut by what stopped it: made again
    absl::StatusOr<RehearsedSet> set = SetFromJson(json);
    if (!set.ok())
      return absl::Status(set.status().code(), absl::StrCat(path, ":", number, ": ", set.status().message()));
    state.sets_.push_back(*std::move(set));
  }
  state.text_ = of.dump() + "\n";
  for (const RehearsedSet& set : state.sets_) absl::StrAppend(&state.text_, ToJson(set).dump(), "\n");
  TOUCHSTONE_RETURN_IF_ERROR(state.Write());
  return state;
}

absl::Status RehearsalState::Add(RehearsedSet set) {
  sets_.push_back(std::move(set));
  if (path_.empty()) return absl::OkStatus();
  absl::StrAppend(&text_, ToJson(sets_.back()).dump(), "\n");
  return Write();
}

absl::Status RehearsalState::Write() const {
  const absl::Status written = WriteFileAtomically(path_, text_);
  return absl::Status(written.code(), written.ok() ? "" : absl::StrCat("--state: ", written.message()));
}

}  // namespace touchstone::cli
