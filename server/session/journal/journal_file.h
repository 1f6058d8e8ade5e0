// The journal in its SQLite file: journal.cpp for sessions and images, journal_trash.cpp for deleting them,
// journal_touches.cpp for touches.
#pragma once

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <initializer_list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "server/base/status.h"
#include "server/session/journal/journal.h"
#include "server/session/journal/journal_open.h"
#include "server/session/journal/journal_seal.h"
#include "server/session/journal/sqlite_file.h"

namespace touchstone::session {

// "begun", "executing", "done", "failed".
const char* StageInWords(TouchStage stage);

class JournalFile : public Journal {
 public:
  explicit JournalFile(OpenedJournal opened)
      : lock_(std::move(opened.lock)),
        file_(std::move(opened.file)),
        skip_damaged_(std::move(opened.skip_damaged)),
        read_only_(lock_ == nullptr) {}

  bool has_checksums() const override { return file_->has_checksums(); }

  absl::Status EnsureSession(const JournalSession& session) override;
  absl::StatusOr<std::vector<JournalSession>> Sessions() const override;
  absl::StatusOr<JournalSession> Session(const std::string& name) const override;
  absl::StatusOr<bool> HasSession(const std::string& name) const override;
  absl::Status SetSessionClock(const std::string& name, const JournalClock& clock) override;
  absl::StatusOr<JournalClock> SessionClock(const std::string& name) const override;
  absl::Status DeleteSession(const std::string& name, const std::string& by) override;
  absl::StatusOr<std::vector<JournalSession>> DeletedSessions() const override;
  absl::Status RestoreSession(const std::string& name) override;
  absl::Status PurgeSession(const std::string& name) override;
  absl::StatusOr<JournalTouch> Begin(const std::string& session, const std::string& id,
                                     const std::string& object, const std::string& up_face,
                                     const std::string& command) override;
  absl::StatusOr<JournalTouch> BeginExecuting(const std::string& session, const std::string& id,
                                              const std::string& object, const std::string& up_face,
                                              const std::string& command, uint32_t program_id,
                                              uint32_t boot_id) override;
  absl::Status Executing(const std::string& session, const std::string& id, uint32_t program_id,
                         uint32_t boot_id) override;
  absl::Status Done(const std::string& session, const std::string& id, const JournalResult& result,
                    const JournalSeries* series) override;
  absl::Status Failed(const std::string& session, const std::string& id, const std::string& error) override;
  absl::Status AddSession(const SessionContent& content) override;
  absl::Status AddFinished(const std::string& session, const std::vector<JournalTouch>& touches,
                           const std::vector<std::optional<JournalSeries>>& series) override;
  absl::StatusOr<std::optional<JournalTouch>> Find(const std::string& session,
                                                   const std::string& id) const override;
  absl::StatusOr<std::optional<JournalSeries>> Series(const std::string& session,
                                                      const std::string& id) const override;
  absl::StatusOr<std::optional<JournalTouch>> LastDone(const std::string& session) const override;
  absl::Status ForEachTouch(const std::string& session,
                            const std::function<bool(const JournalTouch&)>& each) const override;
  absl::StatusOr<std::vector<std::pair<std::string, JournalTouch>>> Unfinished() const override;
  absl::Status AddImage(const std::string& session, const JournalImage& given) override;
  absl::Status ForEachImage(const std::string& session,
                            const std::function<bool(const JournalImage&)>& each) const override;
  absl::Status CopySession(const std::string& name, Journal* to) const override;
  absl::Status SetMetadata(const std::vector<std::pair<std::string, std::string>>& values) override;
  absl::StatusOr<std::string> Metadata(const std::string& key) const override;

 private:
  struct Known {
    int64_t session_id = 0;
    int fingers = 0;
    double spacing_m = 0;
  };

  std::string Called() const { return absl::StrCat("journal ", file_->path(), ": "); }
  absl::Status Wrong(absl::string_view what) const;
  absl::Status CheckName(absl::string_view what, const std::string& name) const;
  absl::Status CheckFingers(const std::string& session, const std::string& id, const Known& known,
                            const JournalResult& result) const;

  // One transaction.
  template <typename Work>
  absl::Status Write(Work work) {
    if (read_only_)
      return absl::FailedPreconditionError(
          absl::StrCat(Called(), "was opened for reading only; nothing can be written to it"));
    return file_->Transact(work);
  }

  // Whether this is damage that may be left out; it was told then.
  bool Skipped(const absl::Status& status) const {
    if (!absl::IsDataLoss(status) || skip_damaged_ == nullptr) return false;
    skip_damaged_(status);
    return true;
  }

  absl::StatusOr<JournalTouch> BeginAs(const std::string& session, JournalTouch touch);
  absl::StatusOr<std::vector<JournalSession>> SessionsWhere(const char* query) const;
  absl::StatusOr<JournalSession> CheckedSession(int64_t session_id) const;
  absl::Status CheckHead(const JournalSession& session) const;
  // Within a transaction.
  absl::Status AppendFinished(const std::string& session, const Known& known,
                              const std::vector<JournalTouch>& touches,
                              const std::vector<std::optional<JournalSeries>>& series, bool keep_numbers,
                              SessionTally* tally);
  absl::Status AppendImage(const std::string& session, const Known& known, const JournalImage& given,
                           SessionTally* tally);
  // journal_trash.cpp; within a transaction.
  absl::Status WantNothingExecuting(int64_t session_id, const std::string& name) const;
  absl::Status Erase(int64_t session_id);

  absl::StatusOr<std::optional<Known>> FindSession(const std::string& name) const;
  absl::StatusOr<Known> WantSession(const std::string& name) const;

  // 0: there is none.
  absl::StatusOr<int64_t> FindTouch(int64_t session_id, const std::string& id) const;
  absl::StatusOr<uint64_t> NextNumber(int64_t session_id) const;

  // A step of a touch from one of these stages.
  template <typename Step>
  absl::Status Advance(const std::string& session, const std::string& id, const char* what,
                       std::initializer_list<TouchStage> from, Step step) {
    const std::lock_guard<std::mutex> lock(mutex_);
    TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(session));
    TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t touch_id, FindTouch(known.session_id, id));
    if (touch_id == 0)
      return absl::NotFoundError(
          absl::StrCat(Called(), "session '", session, "' has no touch '", id, "'; begin it first"));
    TOUCHSTONE_ASSIGN_OR_RETURN(const TouchSeal before, CheckTouch(file_.get(), touch_id));
    if (std::find(from.begin(), from.end(), before.stage) == from.end())
      return absl::FailedPreconditionError(absl::StrCat(Called(), "touch '", id, "' of session '", session,
                                                        "' cannot ", what, ": it is ",
                                                        StageInWords(before.stage)));
    return Write([&]() -> absl::Status {
      TOUCHSTONE_ASSIGN_OR_RETURN(SessionTally tally, ReadTally(file_.get(), known.session_id));
      TOUCHSTONE_RETURN_IF_ERROR(step(known, touch_id));
      TOUCHSTONE_RETURN_IF_ERROR(SealTouch(file_.get(), touch_id, &before, &tally));
      return WriteTally(file_.get(), known.session_id, tally);
    });
  }

  // Without the mutex while `each` runs: it may use this journal. What was there at the call is passed on as it is
  // when its turn comes.
  template <typename Row, typename Ids, typename Read, typename Each>
  absl::Status ForEach(const std::string& session, Ids ids_of, Read read, const Each& each) const {
    std::vector<int64_t> ids;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      const SqliteSnapshot snapshot(file_.get());
      TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(session));
      absl::Status status = CheckSession(file_.get(), known.session_id);
      if (!status.ok() && !Skipped(status)) return status;
      status = ids_of(file_.get(), known.session_id, &ids);
      if (!status.ok() && !Skipped(status)) return status;
    }
    for (const int64_t id : ids) {
      absl::StatusOr<Row> row;
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        row = read(file_.get(), id);
      }
      if (!row.ok() && Skipped(row.status())) continue;
      if (!row.ok()) return row.status();
      if (!each(*row)) break;
    }
    return absl::OkStatus();
  }

  const std::unique_ptr<WriterLock> lock_;  // released last
  const std::unique_ptr<SqliteFile> file_;
  const Journal::SkipDamaged skip_damaged_;
  const bool read_only_;
  mutable std::mutex mutex_;
};

}  // namespace touchstone::session
