#include "server/session/session_files.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

#include <cmath>
#include <limits>
#include <set>

#include "server/base/status.h"
#include "server/base/text.h"
#include "server/session/command_bytes.h"

namespace touchstone {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

}  // namespace

absl::StatusOr<std::vector<MeasuredTouch>> SessionMeasurements(const Journal& journal,
                                                               const std::string& session) {
  std::vector<MeasuredTouch> touches;
  std::vector<uint64_t> ids;
  absl::Status status;
  TOUCHSTONE_RETURN_IF_ERROR(journal.ForEachTouch(session, [&](const JournalTouch& touch) {
    if (touch.stage != TouchStage::kDone) return true;
    const auto command = ParseCommandBytes(touch.command);
    if (!command) {
      status = absl::DataLossError(absl::StrCat("session '", session, "': the command of touch '", touch.id,
                                                "' cannot be read; it is damaged"));
      return false;
    }
    MeasuredTouch& measured = touches.emplace_back();
    measured.touch = touch.number;
    measured.object = touch.object;
    measured.commanded = *command;
    if (!std::isnan(touch.result.session_time_s))
      measured.commanded.set_session_time_s(touch.result.session_time_s);
    for (const JournalFinger& finger : touch.result.fingers) measured.time_s.push_back(finger.contact_time_s);
    measured.round = touch.round;
    measured.face = touch.face;
    // "007" would not come back as it was.
    uint64_t id = 0;
    if (absl::SimpleAtoi(touch.id, &id) && std::to_string(id) == touch.id && id <= 1ull << 53)
      ids.push_back(id);
    return true;
  }));
  TOUCHSTONE_RETURN_IF_ERROR(status);
  if (ids.size() == touches.size())
    for (size_t i = 0; i < ids.size(); ++i) touches[i].touch = ids[i];
  return touches;
}

absl::Status ExportSessionCsv(const Journal& journal, const std::string& session, const std::string& path) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<MeasuredTouch> touches,
                              SessionMeasurements(journal, session));
  if (touches.empty())
    return absl::FailedPreconditionError(absl::StrCat(
        "session '", session, "' has no touch that is done; there is nothing to write to ", path));
  return WriteFileAtomically(path, FormatMeasurements(touches));
}

absl::Status ImportSessionCsv(const std::string& path, const ImportOptions& options, Journal* journal) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<MeasuredTouch> measured, ParseMeasurements(text, path));
  if (measured[0].time_s.empty())
    return absl::InvalidArgumentError(absl::StrCat(
        path, ":1: has no time columns (t_l_us, ...): it is a plan; a measurement file was expected"));
  if (journal->Session(options.session).ok())
    return absl::AlreadyExistsError(absl::StrCat("there is a session '", options.session,
                                                 "' already; import ", path, " under another name"));
  std::vector<JournalTouch> touches(measured.size());
  for (size_t k = 0; k < measured.size(); ++k) {
    JournalTouch& touch = touches[k];
    touch.id = std::to_string(measured[k].touch);
    touch.object = measured[k].object;
    touch.command = CommandBytes(measured[k].commanded);
    touch.stage = TouchStage::kDone;
    touch.round = measured[k].round;
    touch.face = measured[k].face;
    touch.result.session_time_s =
        measured[k].commanded.has_session_time_s() ? measured[k].commanded.session_time_s() : kNan;
    touch.result.start_unix_s = kNan;
    for (const double time_s : measured[k].time_s) {
      JournalFinger& finger = touch.result.fingers.emplace_back();
      finger.contact_time_s = time_s;
      finger.base_from_tip.fill(kNan);
    }
  }
  JournalSession session;
  session.name = options.session;
  session.created_unix_s = options.created_unix_s;
  session.source = options.source.empty() ? absl::StrCat("imported from ", path) : options.source;
  session.fingers = static_cast<int>(measured[0].time_s.size());
  session.spacing_m = options.spacing_m;
  TOUCHSTONE_RETURN_IF_ERROR(journal->EnsureSession(session));
  const absl::Status added = journal->AddFinished(options.session, touches);
  if (!added.ok()) (void)journal->DeleteSession(options.session);
  return added;
}

}  // namespace touchstone
