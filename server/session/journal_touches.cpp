// The touches of a journal: intent, executing, done or failed.
#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/session/command_bytes.h"
#include "server/session/journal_file.h"
#include "server/session/journal_rows.h"

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
  const std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_RETURN_IF_ERROR(CheckName("a touch's id", id));
  TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(session));
  TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t touch_id, FindTouch(known.session_id, id));
  JournalTouch touch;
  if (touch_id != 0) {
    TOUCHSTONE_ASSIGN_OR_RETURN(touch, ReadTouch(file_.get(), touch_id));
    if (touch.object != object || !SameCommand(touch.command, command))
      return absl::AlreadyExistsError(absl::StrCat(
          Called(), "touch id '", id, "' of session '", session, "' stands for another touch",
          touch.object == object ? "" : absl::StrCat(" (of '", touch.object, "', not '", object, "')"),
          "; give this one an id of its own"));
    if (touch.stage == TouchStage::kDone) return touch;
    if (touch.stage != TouchStage::kFailed)
      return absl::AbortedError(absl::StrCat(Called(), "touch '", id, "' of session '", session, "' is ",
                                             StageInWords(touch.stage),
                                             ": it is under way, or an interruption left it and it is not "
                                             "yet reconciled; wait, then ask again"));
  }
  const JournalTouch before = touch;
  touch = JournalTouch{};
  touch.id = id;
  touch.object = object;
  touch.up_face = up_face;
  touch.command = touch_id == 0 ? command : before.command;
  touch.attempt = touch_id == 0 ? 1 : before.attempt + 1;
  TOUCHSTONE_RETURN_IF_ERROR(Write([&]() -> absl::Status {
    TOUCHSTONE_ASSIGN_OR_RETURN(touch.number, NextNumber(known.session_id));
    if (touch_id == 0) return InsertTouch(file_.get(), known.session_id, touch);
    return file_
        ->Prepare(
            "UPDATE touch SET number = ?, placement = ?, stage = 1, attempt = ?, program_id = 0, boot_id = "
            "0, "
            "error = '', round = NULL, face = NULL WHERE touch_id = ?")
        .Bind(static_cast<int64_t>(touch.number))
        .Bind(up_face)
        .Bind(int64_t{touch.attempt})
        .Bind(touch_id)
        .Run();
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

absl::Status JournalFile::Done(const std::string& session, const std::string& id,
                               const JournalResult& result) {
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

absl::Status JournalFile::AddFinished(const std::string& session, const std::vector<JournalTouch>& touches) {
  const std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(session));
  return Write([&]() -> absl::Status {
    TOUCHSTONE_ASSIGN_OR_RETURN(uint64_t number, NextNumber(known.session_id));
    for (JournalTouch touch : touches) {
      TOUCHSTONE_RETURN_IF_ERROR(CheckName("a touch's id", touch.id));
      if (touch.stage != TouchStage::kDone && touch.stage != TouchStage::kFailed)
        return Wrong(absl::StrCat("touch '", touch.id, "' is ", StageInWords(touch.stage),
                                  "; only what has ended can be added"));
      if (touch.stage == TouchStage::kDone)
        TOUCHSTONE_RETURN_IF_ERROR(CheckFingers(session, touch.id, known, touch.result));
      TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t there, FindTouch(known.session_id, touch.id));
      if (there != 0)
        return absl::AlreadyExistsError(absl::StrCat(Called(), "session '", session, "' has a touch '",
                                                     touch.id,
                                                     "' already; add to a session of another name"));
      touch.number = number++;
      TOUCHSTONE_RETURN_IF_ERROR(InsertTouch(file_.get(), known.session_id, touch));
    }
    return absl::OkStatus();
  });
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

absl::Status JournalFile::ForEachTouch(const std::string& session,
                                       const std::function<bool(const JournalTouch&)>& each) const {
  return ForEach<JournalTouch>(session, TouchIds, ReadTouch, each);
}

absl::StatusOr<std::vector<std::pair<std::string, JournalTouch>>> JournalFile::Unfinished() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<std::pair<std::string, int64_t>> found;
  {
    SqliteStatement row = file_->Prepare(
        "SELECT session.name, touch_id FROM touch JOIN session USING(session_id) WHERE stage < 3 "
        "ORDER BY session_id, number");
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
