#include "server/session/journal.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <mutex>

#include "server/base/status.h"
#include "server/base/text.h"
#include "server/session/command_bytes.h"
#include "server/session/journal_open.h"
#include "server/session/journal_rows.h"

namespace touchstone {
namespace {

constexpr size_t kLongestName = 200;  // of sessions and ids, bytes
constexpr int kMaxFingers = 16;

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

class JournalFile : public Journal {
 public:
  explicit JournalFile(OpenedJournal opened)
      : lock_(std::move(opened.lock)), file_(std::move(opened.file)), read_only_(lock_ == nullptr) {}

  absl::Status EnsureSession(const JournalSession& session) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    TOUCHSTONE_RETURN_IF_ERROR(CheckName("a session's name", session.name));
    if (session.fingers < 1 || session.fingers > kMaxFingers || !(session.spacing_m > 0))
      return Wrong(absl::StrCat("session '", session.name, "' has ", session.fingers, " fingers ",
                                ShortestNumber(session.spacing_m * 1e3), " mm apart; 1 to ", kMaxFingers,
                                " and more than 0 mm are possible"));
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<Known> known, FindSession(session.name));
    if (!known) return Write([&] { return InsertSession(file_.get(), session).status(); });
    if (known->fingers == session.fingers && known->spacing_m == session.spacing_m) return absl::OkStatus();
    return absl::FailedPreconditionError(
        absl::StrCat(Called(), "session '", session.name, "' was made with ", known->fingers, " fingers ",
                     ShortestNumber(known->spacing_m * 1e3), " mm apart, not ", session.fingers, " fingers ",
                     ShortestNumber(session.spacing_m * 1e3), " mm apart; begin a session of another name"));
  }

  absl::StatusOr<std::vector<JournalSession>> Sessions() const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::vector<int64_t> ids;
    {
      SqliteStatement row = file_->Prepare("SELECT session_id FROM session ORDER BY session_id");
      while (true) {
        TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
        if (!found) break;
        ids.push_back(row.Integer(0));
      }
    }
    std::vector<JournalSession> sessions;
    for (const int64_t id : ids) {
      TOUCHSTONE_ASSIGN_OR_RETURN(sessions.emplace_back(), ReadSession(file_.get(), id));
    }
    return sessions;
  }

  absl::StatusOr<JournalSession> Session(const std::string& name) const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(name));
    return ReadSession(file_.get(), known.session_id);
  }

  absl::Status DeleteSession(const std::string& name) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(name));
    return Write([&]() -> absl::Status {
      {
        SqliteStatement executing =
            file_->Prepare("SELECT id FROM touch WHERE session_id = ? AND stage = 2 LIMIT 1");
        executing.Bind(known.session_id);
        TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, executing.Step());
        if (found)
          return absl::FailedPreconditionError(
              absl::StrCat(Called(), "session '", name, "' cannot be deleted: its touch '", executing.Text(0),
                           "' is executing; wait until it has ended"));
      }
      for (const char* sql :
           {"DELETE FROM touch_finger WHERE touch_id IN (SELECT touch_id FROM touch WHERE session_id = ?)",
            "DELETE FROM touch WHERE session_id = ?", "DELETE FROM image WHERE session_id = ?",
            "DELETE FROM session_object WHERE session_id = ?", "DELETE FROM session WHERE session_id = ?"})
        TOUCHSTONE_RETURN_IF_ERROR(file_->Prepare(sql).Bind(known.session_id).Run());
      return absl::OkStatus();
    });
  }

  absl::StatusOr<JournalTouch> Begin(const std::string& session, const std::string& id,
                                     const std::string& object, const std::string& placement,
                                     const std::string& command) override {
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
    touch.placement = placement;
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
          .Bind(placement)
          .Bind(int64_t{touch.attempt})
          .Bind(touch_id)
          .Run();
    }));
    return touch;
  }

  absl::Status Executing(const std::string& session, const std::string& id, uint32_t program_id,
                         uint32_t boot_id) override {
    return Advance(session, id, "be executing", {TouchStage::kIntent}, [&](const Known&, int64_t touch_id) {
      return file_->Prepare("UPDATE touch SET stage = 2, program_id = ?, boot_id = ? WHERE touch_id = ?")
          .Bind(int64_t{program_id})
          .Bind(int64_t{boot_id})
          .Bind(touch_id)
          .Run();
    });
  }

  absl::Status Done(const std::string& session, const std::string& id, const JournalResult& result) override {
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

  absl::Status Failed(const std::string& session, const std::string& id, const std::string& error) override {
    return Advance(session, id, "fail", {TouchStage::kIntent, TouchStage::kExecuting},
                   [&](const Known&, int64_t touch_id) {
                     return file_->Prepare("UPDATE touch SET stage = 4, error = ? WHERE touch_id = ?")
                         .Bind(error)
                         .Bind(touch_id)
                         .Run();
                   });
  }

  absl::Status AddFinished(const std::string& session, const std::vector<JournalTouch>& touches) override {
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

  absl::StatusOr<std::optional<JournalTouch>> Find(const std::string& session,
                                                   const std::string& id) const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(session));
    TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t touch_id, FindTouch(known.session_id, id));
    if (touch_id == 0) return std::optional<JournalTouch>();
    TOUCHSTONE_ASSIGN_OR_RETURN(JournalTouch touch, ReadTouch(file_.get(), touch_id));
    return std::optional<JournalTouch>(std::move(touch));
  }

  absl::Status ForEachTouch(const std::string& session,
                            const std::function<bool(const JournalTouch&)>& each) const override {
    return ForEach<JournalTouch>(session, TouchIds, ReadTouch, each);
  }

  absl::StatusOr<std::vector<std::pair<std::string, JournalTouch>>> Unfinished() const override {
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

  absl::Status AddImage(const std::string& session, const JournalImage& given) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(session));
    return Write([&]() -> absl::Status {
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
                                                       image.id,
                                                       "' already; give this one an id of its own"));
      }
      return InsertImage(file_.get(), known.session_id, image);
    });
  }

  absl::Status ForEachImage(const std::string& session,
                            const std::function<bool(const JournalImage&)>& each) const override {
    return ForEach<JournalImage>(session, ImageIds, ReadImage, each);
  }

  absl::Status CopySession(const std::string& name, Journal* to) const override {
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
      TOUCHSTONE_ASSIGN_OR_RETURN(const JournalSession session, ReadSession(file_.get(), known.session_id));
      TOUCHSTONE_ASSIGN_OR_RETURN(const int64_t session_id, InsertSession(target->file_.get(), session));
      TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<int64_t> touches,
                                  TouchIds(file_.get(), known.session_id));
      for (const int64_t id : touches) {
        TOUCHSTONE_ASSIGN_OR_RETURN(const JournalTouch touch, ReadTouch(file_.get(), id));
        TOUCHSTONE_RETURN_IF_ERROR(InsertTouch(target->file_.get(), session_id, touch));
      }
      TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<int64_t> images, ImageIds(file_.get(), known.session_id));
      for (const int64_t id : images) {
        TOUCHSTONE_ASSIGN_OR_RETURN(const JournalImage image, ReadImage(file_.get(), id));
        TOUCHSTONE_RETURN_IF_ERROR(InsertImage(target->file_.get(), session_id, image));
      }
      return absl::OkStatus();
    });
  }

  absl::Status SetFact(const std::string& key, const std::string& value) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return Write([&] {
      return file_
          ->Prepare(
              "INSERT INTO fact(key, value) VALUES(?, ?) ON CONFLICT(key) DO UPDATE SET value = "
              "excluded.value")
          .Bind(key)
          .Bind(value)
          .Run();
    });
  }

  absl::StatusOr<std::string> Fact(const std::string& key) const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    SqliteStatement row = file_->Prepare("SELECT value FROM fact WHERE key = ?");
    row.Bind(key);
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
    return found ? row.Text(0) : std::string();
  }

 private:
  struct Known {
    int64_t session_id = 0;
    int fingers = 0;
    double spacing_m = 0;
  };

  std::string Called() const { return absl::StrCat("journal ", file_->path(), ": "); }
  absl::Status Wrong(absl::string_view what) const {
    return absl::InvalidArgumentError(absl::StrCat(Called(), what));
  }

  absl::Status CheckName(absl::string_view what, const std::string& name) const {
    if (!name.empty() && name.size() <= kLongestName && name.find('\0') == std::string::npos)
      return absl::OkStatus();
    return Wrong(absl::StrCat(what, " has ", name.size(), " bytes",
                              name.empty() ? "" : absl::StrCat(" ('", name.substr(0, 40), "')"), "; 1 to ",
                              kLongestName, " without zero bytes are possible"));
  }

  absl::Status CheckFingers(const std::string& session, const std::string& id, const Known& known,
                            const JournalResult& result) const {
    if (result.fingers.size() == static_cast<size_t>(known.fingers)) return absl::OkStatus();
    return Wrong(absl::StrCat("the result of touch '", id, "' has ", result.fingers.size(),
                              " fingers; session '", session, "' has ", known.fingers));
  }

  // One transaction.
  template <typename Work>
  absl::Status Write(Work work) {
    if (read_only_)
      return absl::FailedPreconditionError(
          absl::StrCat(Called(), "was opened for reading only; nothing can be written to it"));
    return file_->Transact(work);
  }

  absl::StatusOr<std::optional<Known>> FindSession(const std::string& name) const {
    SqliteStatement row = file_->Prepare("SELECT session_id, fingers, spacing_m FROM session WHERE name = ?");
    row.Bind(name);
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
    if (!found) return std::optional<Known>();
    return std::optional<Known>(Known{row.Integer(0), static_cast<int>(row.Integer(1)), row.Double(2)});
  }

  absl::StatusOr<Known> WantSession(const std::string& name) const {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<Known> known, FindSession(name));
    if (known) return *known;
    std::vector<std::string> names;
    SqliteStatement row = file_->Prepare("SELECT name FROM session ORDER BY session_id DESC LIMIT 100");
    while (true) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
      if (!found) break;
      names.push_back(row.Text(0));
    }
    return absl::NotFoundError(absl::StrCat(Called(), "there is no session '", name, "'",
                                            names.empty() ? "; it has none" : DidYouMean(name, names)));
  }

  // 0: there is none.
  absl::StatusOr<int64_t> FindTouch(int64_t session_id, const std::string& id) const {
    SqliteStatement row = file_->Prepare("SELECT touch_id FROM touch WHERE session_id = ? AND id = ?");
    row.Bind(session_id).Bind(id);
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, row.Step());
    return found ? row.Integer(0) : int64_t{0};
  }

  absl::StatusOr<uint64_t> NextNumber(int64_t session_id) const {
    SqliteStatement row =
        file_->Prepare("SELECT coalesce(max(number) + 1, 0) FROM touch WHERE session_id = ?");
    row.Bind(session_id);
    TOUCHSTONE_RETURN_IF_ERROR(row.Step().status());
    return static_cast<uint64_t>(row.Integer(0));
  }

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
    TouchStage stage;
    {
      SqliteStatement row = file_->Prepare("SELECT stage FROM touch WHERE touch_id = ?");
      row.Bind(touch_id);
      TOUCHSTONE_RETURN_IF_ERROR(row.Step().status());
      stage = static_cast<TouchStage>(row.Integer(0));
    }
    if (std::find(from.begin(), from.end(), stage) == from.end())
      return absl::FailedPreconditionError(absl::StrCat(Called(), "touch '", id, "' of session '", session,
                                                        "' cannot ", what, ": it is ", StageInWords(stage)));
    return Write([&] { return step(known, touch_id); });
  }

  // Without the mutex while `each` runs: it may use this journal. What was there at the call is passed on as it is
  // when its turn comes.
  template <typename Row, typename Ids, typename Read, typename Each>
  absl::Status ForEach(const std::string& session, Ids ids_of, Read read, const Each& each) const {
    std::vector<int64_t> ids;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      TOUCHSTONE_ASSIGN_OR_RETURN(const Known known, WantSession(session));
      TOUCHSTONE_ASSIGN_OR_RETURN(ids, ids_of(file_.get(), known.session_id));
    }
    for (const int64_t id : ids) {
      absl::StatusOr<Row> row;
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        row = read(file_.get(), id);
      }
      if (!row.ok()) return row.status();
      if (!each(*row)) break;
    }
    return absl::OkStatus();
  }

  const std::unique_ptr<WriterLock> lock_;  // released last
  const std::unique_ptr<SqliteFile> file_;
  const bool read_only_;
  mutable std::mutex mutex_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Journal>> Journal::Open(const std::string& path, Mode mode) {
  TOUCHSTONE_ASSIGN_OR_RETURN(OpenedJournal opened, OpenJournalFile(path, mode));
  return std::unique_ptr<Journal>(new JournalFile(std::move(opened)));
}

}  // namespace touchstone
