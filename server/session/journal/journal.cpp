#include "server/session/journal/journal.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/base/text/file_number.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/session/journal/journal_file.h"
#include "server/session/journal/journal_head.h"
#include "server/session/journal/journal_rows.h"

namespace touchstone::session {
namespace {

constexpr size_t kMaxNameBytes = 200;  // of sessions and ids
constexpr int kMaxFingers = 16;

}  // namespace

absl::Status JournalFile::EnsureSession(const JournalSession& session) {
  const std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_RETURN_IF_ERROR(CheckHead(session));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<Known> known, FindSession(session.name));
  if (!known) return Write([&] { return InsertSession(file_.get(), session).status(); });
  if (known->fingers == session.fingers && known->spacing_m == session.spacing_m) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      Called(), "session '", session.name, "' was made with ", known->fingers, " fingers ",
      FileNumber(Unit::kMillimetre, known->spacing_m), " mm apart, not ", session.fingers, " fingers ",
      FileNumber(Unit::kMillimetre, session.spacing_m), " mm apart; begin a session of another name"));
}

absl::Status JournalFile::CheckHead(const JournalSession& session) const {
  TOUCHSTONE_RETURN_IF_ERROR(CheckName("a session's name", session.name));
  if (session.fingers >= 1 && session.fingers <= kMaxFingers && session.spacing_m > 0)
    return absl::OkStatus();
  return Wrong(absl::StrCat("session '", session.name, "' has ", session.fingers, " fingers ",
                            FileNumber(Unit::kMillimetre, session.spacing_m), " mm apart; 1 to ", kMaxFingers,
                            " and more than 0 mm are possible"));
}

absl::Status JournalFile::AddSession(const SessionContent& content) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const JournalSession& session = content.session;
  TOUCHSTONE_RETURN_IF_ERROR(CheckHead(session));
  return Write([&]() -> absl::Status {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<Known> there, FindSession(session.name));
    if (there)
      return absl::AlreadyExistsError(absl::StrCat(Called(), "there is a session '", session.name,
                                                   "' already; give the new one another name"));
    TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t session_id, InsertSession(file_.get(), session));
    const Known known{session_id, session.fingers, session.spacing_m};
    SessionTally tally;
    // A touch that was tried again left a gap.
    const std::vector<JournalTouch>& touches = content.touches;
    const bool rising = std::adjacent_find(touches.begin(), touches.end(), [](const auto& a, const auto& b) {
                          return a.number >= b.number;
                        }) == touches.end();
    TOUCHSTONE_RETURN_IF_ERROR(AppendFinished(session.name, known, touches, content.series, rising, &tally));
    for (const JournalImage& image : content.images)
      TOUCHSTONE_RETURN_IF_ERROR(AppendImage(session.name, known, image, &tally));
    return WriteTally(file_.get(), session_id, tally);
  });
}

absl::StatusOr<std::vector<JournalSession>> JournalFile::Sessions() const {
  return SessionsWhere(
      "SELECT session_id FROM session NOT INDEXED WHERE deleted_unix_s IS NULL ORDER BY session_id");
}

absl::StatusOr<std::vector<JournalSession>> JournalFile::SessionsWhere(const char* query) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const SqliteSnapshot snapshot(file_.get());
  const absl::Status counted = CheckSessionCount(file_.get());
  if (!counted.ok() && !Skipped(counted)) return counted;
  std::vector<int64_t> ids;
  {
    SqliteStatement row = file_->Prepare(query);
    while (true) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
      if (!found) break;
      ids.push_back(row.Integer(0));
    }
  }
  std::vector<JournalSession> sessions;
  for (const int64_t id : ids) {
    TOUCHSTONE_ASSIGN_OR_RETURN(sessions.emplace_back(), CheckedSession(id));
  }
  return sessions;
}

absl::StatusOr<JournalSession> JournalFile::CheckedSession(int64_t session_id) const {
  const absl::Status whole = CheckSession(file_.get(), session_id);
  if (!whole.ok() && !Skipped(whole)) return whole;
  absl::StatusOr<JournalSession> session = ReadSession(file_.get(), session_id);
  if (Skipped(session.status())) return ReadSession(file_.get(), session_id, false);
  return session;
}

absl::StatusOr<JournalSession> JournalFile::Session(const std::string& name) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const SqliteSnapshot snapshot(file_.get());
  TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(name));
  return CheckedSession(known.session_id);
}

absl::StatusOr<bool> JournalFile::HasSession(const std::string& name) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<Known> known, FindSession(name));
  return known.has_value();
}

absl::Status JournalFile::SetSessionClock(const std::string& name, const JournalClock& clock) {
  const std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(name));
  return Write([&]() -> absl::Status {
    TOUCHSTONE_RETURN_IF_ERROR(CheckSession(file_.get(), known.session_id));
    TOUCHSTONE_RETURN_IF_ERROR(
        file_->Prepare("UPDATE session SET clock_boot_id = ?, clock_origin_s = ? WHERE session_id = ?")
            .Bind(clock.boot_id)
            .Bind(clock.origin_s)
            .Bind(known.session_id)
            .Run());
    return SealSession(file_.get(), known.session_id);
  });
}

absl::StatusOr<JournalClock> JournalFile::SessionClock(const std::string& name) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const SqliteSnapshot snapshot(file_.get());
  TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(name));
  TOUCHSTONE_RETURN_IF_ERROR(CheckSession(file_.get(), known.session_id));
  SqliteStatement row =
      file_->Prepare("SELECT clock_boot_id, clock_origin_s FROM session WHERE session_id = ?");
  row.Bind(known.session_id);
  TOUCHSTONE_RETURN_IF_ERROR(row.Step().status());
  return JournalClock{row.Text(0), row.Double(1)};
}

absl::Status JournalFile::AddImage(const std::string& session, const JournalImage& given) {
  const std::lock_guard<std::mutex> lock(mutex_);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(session));
  return Write([&]() -> absl::Status {
    TOUCHSTONE_ASSIGN_OR_RETURN(SessionTally tally, ReadTally(file_.get(), known.session_id));
    TOUCHSTONE_RETURN_IF_ERROR(AppendImage(session, known, given, &tally));
    return WriteTally(file_.get(), known.session_id, tally);
  });
}

absl::Status JournalFile::AppendImage(const std::string& session, const Known& known,
                                      const JournalImage& given, SessionTally* tally) {
  JournalImage image = given;
  {
    SqliteStatement next =
        file_->Prepare("SELECT coalesce(max(number) + 1, 0) FROM image WHERE session_id = ?");
    next.Bind(known.session_id);
    TOUCHSTONE_RETURN_IF_ERROR(next.Step().status());
    image.number = static_cast<uint64_t>(next.Integer(0));
  }
  if (image.id.empty()) image.id = absl::StrCat("image-", image.number);
  TOUCHSTONE_RETURN_IF_ERROR(CheckName("a picture's id", image.id));
  {
    SqliteStatement same = file_->Prepare("SELECT 1 FROM image WHERE session_id = ? AND id = ?");
    same.Bind(known.session_id).Bind(image.id);
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, same.Step());
    if (found)
      return absl::AlreadyExistsError(absl::StrCat(Called(), "session '", session, "' has a picture '",
                                                   image.id, "' already; give this one an id of its own"));
  }
  return InsertImage(file_.get(), known.session_id, image, tally);
}

absl::Status JournalFile::ForEachImage(const std::string& session,
                                       const std::function<bool(const JournalImage&)>& each) const {
  return ForEach<JournalImage>(session, ReadImageIds, ReadImage, each);
}

absl::Status JournalFile::CopySession(const std::string& name, Journal* to) const {
  auto* const target = static_cast<JournalFile*>(to);  // Open makes no other
  if (target == this)
    return Wrong(
        absl::StrCat("session '", name, "' cannot be copied into its own journal; name another file"));
  const std::scoped_lock lock(mutex_, target->mutex_);
  TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(name));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<Known> there, target->FindSession(name));
  if (there)
    return absl::AlreadyExistsError(
        absl::StrCat(target->Called(), "has a session '", name, "' already; name another file"));
  return target->Write([&]() -> absl::Status {
    const SqliteSnapshot snapshot(file_.get());
    TOUCHSTONE_ASSIGN_OR_RETURN(const JournalSession session, CheckedSession(known.session_id));
    TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t session_id, InsertSession(target->file_.get(), session));
    SessionTally tally;
    std::vector<int64_t> ids;
    TOUCHSTONE_RETURN_IF_ERROR(ReadTouchIds(file_.get(), known.session_id, &ids));
    for (const int64_t id : ids) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const JournalTouch touch, ReadTouch(file_.get(), id));
      TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<JournalSeries> series, ReadSeries(file_.get(), id));
      TOUCHSTONE_RETURN_IF_ERROR(
          InsertTouch(target->file_.get(), session_id, touch, series ? &*series : nullptr, &tally));
    }
    ids.clear();
    TOUCHSTONE_RETURN_IF_ERROR(ReadImageIds(file_.get(), known.session_id, &ids));
    for (const int64_t id : ids) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const JournalImage image, ReadImage(file_.get(), id));
      TOUCHSTONE_RETURN_IF_ERROR(InsertImage(target->file_.get(), session_id, image, &tally));
    }
    return WriteTally(target->file_.get(), session_id, tally);
  });
}

absl::Status JournalFile::SetMetadata(const std::vector<std::pair<std::string, std::string>>& values) {
  const std::lock_guard<std::mutex> lock(mutex_);
  return Write([&]() -> absl::Status {
    for (const auto& [key, value] : values) TOUCHSTONE_RETURN_IF_ERROR(WriteFact(file_.get(), key, value));
    return absl::OkStatus();
  });
}

absl::StatusOr<std::string> JournalFile::Metadata(const std::string& key) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return ReadFact(file_.get(), key);
}

absl::Status JournalFile::Wrong(absl::string_view what) const {
  return absl::InvalidArgumentError(absl::StrCat(Called(), what));
}

absl::Status JournalFile::CheckName(absl::string_view what, const std::string& name) const {
  if (!name.empty() && name.size() <= kMaxNameBytes && name.find('\0') == std::string::npos)
    return absl::OkStatus();
  return Wrong(absl::StrCat(what, " has ", name.size(), " bytes",
                            name.empty() ? "" : absl::StrCat(" ('", name.substr(0, 40), "')"), "; 1 to ",
                            kMaxNameBytes, " without zero bytes are possible"));
}

absl::StatusOr<std::optional<JournalFile::Known>> JournalFile::FindSession(const std::string& name) const {
  SqliteStatement row = file_->Prepare(
      "SELECT session_id, fingers, spacing_m FROM session WHERE name = ? AND deleted_unix_s IS NULL");
  row.Bind(name);
  TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
  if (!found) return std::optional<Known>();
  return std::optional<Known>(Known{row.Integer(0), static_cast<int>(row.Integer(1)), row.Double(2)});
}

absl::StatusOr<JournalFile::Known> JournalFile::WantSession(const std::string& name) const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<Known> known, FindSession(name));
  if (known) return *known;
  std::vector<std::string> names;
  SqliteStatement row = file_->Prepare(
      "SELECT name FROM session WHERE deleted_unix_s IS NULL ORDER BY session_id DESC LIMIT 100");
  while (true) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
    if (!found) break;
    names.push_back(row.Text(0));
  }
  return absl::NotFoundError(absl::StrCat(Called(), "there is no session '", name, "'",
                                          names.empty() ? "; it has none" : DidYouMean(name, names)));
}

absl::StatusOr<std::unique_ptr<Journal>> Journal::Open(const std::string& path, Mode mode,
                                                       SkipDamaged skip_damaged) {
  TOUCHSTONE_ASSIGN_OR_RETURN(OpenedJournal opened, OpenJournalFile(path, mode));
  if (skip_damaged != nullptr && mode != Mode::kReadOnly)
    return absl::InvalidArgumentError(
        absl::StrCat("journal ", path, ": damage can be left out in reading only, never in writing"));
  opened.skip_damaged = std::move(skip_damaged);
  return std::unique_ptr<Journal>(new JournalFile(std::move(opened)));
}

}  // namespace touchstone::session
