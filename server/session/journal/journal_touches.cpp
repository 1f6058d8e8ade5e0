// The touches of a journal: intent, executing, done or failed.
#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/session/journal/command_bytes.h"
#include "server/session/journal/journal_file.h"
#include "server/session/journal/journal_rows.h"

namespace touchstone::session {

const char* StageInWords(TouchStage stage) {
  switch (stage) {
    case TouchStage::kIntent:
      return "begun";
    case TouchStage::kExecuting:
      return "executing";
    case TouchStage::kDone:
      return "done";
    case TouchStage::kFailed:
      return "failed";
  }
  return "unknown";
}

absl::StatusOr<JournalTouch> JournalFile::Begin(const std::string& session, const std::string& id,
                                                const std::string& object, const std::string& up_face,
                                                const std::string& command) {
  JournalTouch touch;
  touch.id = id, touch.object = object, touch.up_face = up_face, touch.command = command;
  return BeginAs(session, std::move(touch));
}

absl::StatusOr<JournalTouch> JournalFile::BeginExecuting(const std::string& session, const std::string& id,
                                                         const std::string& object,
                                                         const std::string& up_face,
                                                         const std::string& command, uint32_t program_id,
                                                         uint32_t boot_id) {
  JournalTouch touch;
  touch.id = id, touch.object = object, touch.up_face = up_face, touch.command = command;
  touch.stage = TouchStage::kExecuting;
  touch.program_id = program_id, touch.boot_id = boot_id;
  return BeginAs(session, std::move(touch));
}

absl::StatusOr<JournalTouch> JournalFile::BeginAs(const std::string& session, JournalTouch touch) {
  const std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_RETURN_IF_ERROR(CheckName("a touch's id", touch.id));
  TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(session));
  TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t touch_id, FindTouch(known.session_id, touch.id));
  if (touch_id != 0) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const JournalTouch before, ReadTouch(file_.get(), touch_id));
    if (before.object != touch.object || !SameCommand(before.command, touch.command))
      return absl::AlreadyExistsError(absl::StrCat(
          Called(), "touch id '", touch.id, "' of session '", session, "' stands for another touch",
          before.object == touch.object
              ? ""
              : absl::StrCat(" (of '", before.object, "', not '", touch.object, "')"),
          "; give this one an id of its own"));
    if (before.stage == TouchStage::kDone) return before;
    if (before.stage != TouchStage::kFailed)
      return absl::AbortedError(absl::StrCat(Called(), "touch '", touch.id, "' of session '", session,
                                             "' is ", StageInWords(before.stage),
                                             ": it is under way, or an interruption left it and it is not "
                                             "yet reconciled; wait, then ask again"));
    touch.command = before.command;
    touch.attempt = before.attempt + 1;
  }
  TOUCHSTONE_RETURN_IF_ERROR(Write([&]() -> absl::Status {
    TOUCHSTONE_ASSIGN_OR_RETURN(SessionTally tally, ReadTally(file_.get(), known.session_id));
    TOUCHSTONE_ASSIGN_OR_RETURN(touch.number, NextNumber(known.session_id));
    if (touch_id == 0) {
      TOUCHSTONE_RETURN_IF_ERROR(InsertTouch(file_.get(), known.session_id, touch, nullptr, &tally));
      return WriteTally(file_.get(), known.session_id, tally);
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(const TouchSeal before, CheckTouch(file_.get(), touch_id));
    TOUCHSTONE_RETURN_IF_ERROR(
        file_
            ->Prepare("UPDATE touch SET number = ?, placement = ?, stage = ?, attempt = ?, program_id = ?, "
                      "boot_id = ?, error = '', round = NULL, face = NULL WHERE touch_id = ?")
            .Bind(static_cast<int64_t>(touch.number))
            .Bind(touch.up_face)
            .Bind(static_cast<int64_t>(touch.stage))
            .Bind(int64_t{touch.attempt})
            .Bind(int64_t{touch.program_id})
            .Bind(int64_t{touch.boot_id})
            .Bind(touch_id)
            .Run());
    TOUCHSTONE_RETURN_IF_ERROR(SealTouch(file_.get(), touch_id, &before, &tally));
    return WriteTally(file_.get(), known.session_id, tally);
  }));
  return touch;
}

absl::Status JournalFile::Executing(const std::string& session, const std::string& id, uint32_t program_id,
                                    uint32_t boot_id) {
  return Advance(session, id, "be executing", {TouchStage::kIntent}, [&](const Known&, int64_t touch_id) {
    return file_->Prepare("UPDATE touch SET stage = 2, program_id = ?, boot_id = ? WHERE touch_id = ?")
        .Bind(int64_t{program_id})
        .Bind(int64_t{boot_id})
        .Bind(touch_id)
        .Run();
  });
}

absl::Status JournalFile::Done(const std::string& session, const std::string& id, const JournalResult& result,
                               const JournalSeries* series) {
  return Advance(
      session, id, "be done", {TouchStage::kExecuting},
      [&](const Known& known, int64_t touch_id) -> absl::Status {
        TOUCHSTONE_RETURN_IF_ERROR(CheckFingers(session, id, known, result));
        SqliteStatement update = file_->Prepare(
            "UPDATE touch SET stage = 3, measured_speed_m_s = ?, session_time_s = ?, start_unix_s = ?, "
            "time_uncertainty_s = ?, synchronisation_uncertainty_s = ?, effector_drift = ?, recovered = ? "
            "WHERE touch_id = ?");
        update.Bind(result.speed_m_s).Bind(result.session_time_s).Bind(result.start_unix_s);
        update.Bind(result.time_uncertainty_s).Bind(result.synchronisation_uncertainty_s);
        update.Bind(result.effector_drift).Bind(int64_t{result.recovered}).Bind(touch_id);
        TOUCHSTONE_RETURN_IF_ERROR(update.Run());
        if (series != nullptr) TOUCHSTONE_RETURN_IF_ERROR(InsertSeries(file_.get(), touch_id, *series));
        return InsertFingers(file_.get(), touch_id, result.fingers);
      });
}

absl::Status JournalFile::Failed(const std::string& session, const std::string& id,
                                 const std::string& error) {
  return Advance(session, id, "fail", {TouchStage::kIntent, TouchStage::kExecuting},
                 [&](const Known&, int64_t touch_id) {
                   return file_->Prepare("UPDATE touch SET stage = 4, error = ? WHERE touch_id = ?")
                       .Bind(error)
                       .Bind(touch_id)
                       .Run();
                 });
}

absl::Status JournalFile::AddFinished(const std::string& session, const std::vector<JournalTouch>& touches,
                                      const std::vector<std::optional<JournalSeries>>& series) {
  const std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(session));
  return Write([&]() -> absl::Status {
    TOUCHSTONE_ASSIGN_OR_RETURN(SessionTally tally, ReadTally(file_.get(), known.session_id));
    TOUCHSTONE_RETURN_IF_ERROR(
        AppendFinished(session, known, touches, series, /*keep_numbers=*/false, &tally));
    return WriteTally(file_.get(), known.session_id, tally);
  });
}

absl::Status JournalFile::AppendFinished(const std::string& session, const Known& known,
                                         const std::vector<JournalTouch>& touches,
                                         const std::vector<std::optional<JournalSeries>>& series,
                                         bool keep_numbers, SessionTally* tally) {
  TOUCHSTONE_ASSIGN_OR_RETURN(uint64_t number, NextNumber(known.session_id));
  for (size_t k = 0; k < touches.size(); ++k) {
    JournalTouch touch = touches[k];
    TOUCHSTONE_RETURN_IF_ERROR(CheckName("a touch's id", touch.id));
    if (touch.stage != TouchStage::kDone && touch.stage != TouchStage::kFailed)
      return Wrong(absl::StrCat("touch '", touch.id, "' is ", StageInWords(touch.stage),
                                "; only what has ended can be added"));
    if (touch.stage == TouchStage::kDone)
      TOUCHSTONE_RETURN_IF_ERROR(CheckFingers(session, touch.id, known, touch.result));
    TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t there, FindTouch(known.session_id, touch.id));
    if (there != 0)
      return absl::AlreadyExistsError(absl::StrCat(Called(), "session '", session, "' has a touch '",
                                                   touch.id, "' already; add to a session of another name"));
    if (!keep_numbers) touch.number = number++;
    TOUCHSTONE_RETURN_IF_ERROR(InsertTouch(file_.get(), known.session_id, touch,
                                           k < series.size() && series[k] ? &*series[k] : nullptr, tally));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::optional<JournalTouch>> JournalFile::Find(const std::string& session,
                                                              const std::string& id) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(session));
  TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t touch_id, FindTouch(known.session_id, id));
  if (touch_id == 0) return std::optional<JournalTouch>();
  TOUCHSTONE_ASSIGN_OR_RETURN(JournalTouch touch, ReadTouch(file_.get(), touch_id));
  return std::optional<JournalTouch>(std::move(touch));
}

absl::StatusOr<std::optional<JournalSeries>> JournalFile::Series(const std::string& session,
                                                                 const std::string& id) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(session));
  TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t touch_id, FindTouch(known.session_id, id));
  if (touch_id == 0) return std::optional<JournalSeries>();
  absl::StatusOr<std::optional<JournalSeries>> series = ReadSeries(file_.get(), touch_id);
  if (Skipped(series.status())) return std::optional<JournalSeries>();
  return series;
}

absl::StatusOr<std::optional<JournalTouch>> JournalFile::LastDone(const std::string& session) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(session));
  int64_t touch_id = 0;
  {
    SqliteStatement row = file_->Prepare(
        "SELECT touch_id FROM touch WHERE session_id = ? AND stage = 3 ORDER BY number DESC LIMIT 1");
    row.Bind(known.session_id);
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
    if (!found) return std::optional<JournalTouch>();
    touch_id = row.Integer(0);
  }
  TOUCHSTONE_ASSIGN_OR_RETURN(JournalTouch touch, ReadTouch(file_.get(), touch_id));
  return std::optional<JournalTouch>(std::move(touch));
}

absl::Status JournalFile::ForEachTouch(const std::string& session,
                                       const std::function<bool(const JournalTouch&)>& each) const {
  return ForEach<JournalTouch>(session, ReadTouchIds, ReadTouch, each);
}

absl::StatusOr<std::vector<std::pair<std::string, JournalTouch>>> JournalFile::Unfinished() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<std::pair<std::string, int64_t>> found;
  {
    SqliteStatement row = file_->Prepare(
        "SELECT session.name, touch_id FROM touch JOIN session USING(session_id) WHERE stage < 3 "
        "AND deleted_unix_s IS NULL ORDER BY session_id, number");
    while (true) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool more, row.Step());
      if (!more) break;
      found.emplace_back(row.Text(0), row.Integer(1));
    }
  }
  std::vector<std::pair<std::string, JournalTouch>> touches;
  for (const auto& [name, touch_id] : found) {
    TOUCHSTONE_ASSIGN_OR_RETURN(JournalTouch touch, ReadTouch(file_.get(), touch_id));
    touches.emplace_back(name, std::move(touch));
  }
  return touches;
}

absl::Status JournalFile::CheckFingers(const std::string& session, const std::string& id, const Known& known,
                                       const JournalResult& result) const {
  if (result.fingers.size() == static_cast<size_t>(known.fingers)) return absl::OkStatus();
  return Wrong(absl::StrCat("the result of touch '", id, "' has ", result.fingers.size(),
                            " fingers; session '", session, "' has ", known.fingers));
}

absl::StatusOr<int64_t> JournalFile::FindTouch(int64_t session_id, const std::string& id) const {
  SqliteStatement row = file_->Prepare("SELECT touch_id FROM touch WHERE session_id = ? AND id = ?");
  row.Bind(session_id).Bind(id);
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
  return found ? row.Integer(0) : int64_t{0};
}

absl::StatusOr<uint64_t> JournalFile::NextNumber(int64_t session_id) const {
  SqliteStatement row = file_->Prepare("SELECT coalesce(max(number) + 1, 0) FROM touch WHERE session_id = ?");
  row.Bind(session_id);
  TOUCHSTONE_RETURN_IF_ERROR(row.Step().status());
  return static_cast<uint64_t>(row.Integer(0));
}

}  // namespace touchstone::session
