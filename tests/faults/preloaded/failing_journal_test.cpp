// A journal that stays open, as a gateway's, with the disk failing at each of its calls in turn: every step is there whole once
// it is acknowledged, and left no trace if it was refused; the same step, once more, goes on.
#include <absl/strings/str_cat.h>

#include "server/base/test_tier.h"
#include "tests/faults/preloaded/failing_test.h"

namespace touchstone::faults {
namespace {

using session::Journal;
using session::TouchStage;

struct Step {
  const char* name;
  std::function<absl::Status(Journal*)> run;
};

session::JournalSession SessionNamed(const std::string& name) {
  session::JournalSession session;
  session.name = name;
  session.fingers = 1;
  return session;
}

session::JournalResult ResultAt(double time_s) {
  session::JournalResult result;
  result.fingers.resize(1);
  result.fingers[0].contact_time_s = time_s;
  return result;
}

session::JournalImage Picture() {
  session::JournalImage image;
  image.id = "front", image.object = "cup", image.width = image.height = 80;
  image.png = std::string(30'000, 'x');  // several pages
  return image;
}

std::vector<session::JournalTouch> MadeElsewhere() {
  session::JournalTouch touch;
  touch.id = "other", touch.object = "cup", touch.up_face = "+z", touch.command = "c";
  touch.stage = TouchStage::kDone, touch.result = ResultAt(0.5);
  return {touch};
}

// What a rig and an import do, each of them one transaction.
const std::vector<Step>& Steps() {
  static const std::vector<Step> steps = {
      {"EnsureSession", [](Journal* j) { return j->EnsureSession(SessionNamed("s")); }},
      {"BeginExecuting",
       [](Journal* j) { return j->BeginExecuting("s", "a", "cup", "+z", "c", 1, 1).status(); }},
      {"Done",
       [](Journal* j) {
         const session::JournalSeries series{"raw", std::string(9000, 'y')};
         return j->Done("s", "a", ResultAt(0.25), &series);
       }},
      {"Begin", [](Journal* j) { return j->Begin("s", "b", "cup", "+z", "c").status(); }},
      {"Executing", [](Journal* j) { return j->Executing("s", "b", 2, 1); }},
      {"Failed", [](Journal* j) { return j->Failed("s", "b", "the arm was stopped"); }},
      {"a second attempt",
       [](Journal* j) { return j->BeginExecuting("s", "b", "cup", "+z", "c", 3, 1).status(); }},
      {"SetMetadata",
       [](Journal* j) {
         return j->SetMetadata({{"stop", "by ana"}, {"motion_under_way", ""}});
       }},
      {"SetSessionClock",
       [](Journal* j) {
         return j->SetSessionClock("s", {"boot", 4.5});
       }},
      {"AddImage", [](Journal* j) { return j->AddImage("s", Picture()); }},
      {"AddFinished", [](Journal* j) { return j->AddFinished("s", MadeElsewhere()); }},
      {"Failed again", [](Journal* j) { return j->Failed("s", "b", "once more"); }},
      {"DeleteSession", [](Journal* j) { return j->DeleteSession("s", "ana"); }},
      {"RestoreSession", [](Journal* j) { return j->RestoreSession("s"); }}};
  return steps;
}

std::string TextOf(const Journal& journal) {
  std::string text;
  const auto sessions = journal.Sessions();
  if (!sessions.ok()) return sessions.status().ToString();
  for (const session::JournalSession& session : *sessions) {
    const auto clock = journal.SessionClock(session.name);
    absl::StrAppend(&text, "session ", session.name, " ", session.touches, " ", session.done, " ",
                    session.failed, " ", clock.ok() ? clock->boot_id : clock.status().ToString(), "\n");
    const absl::Status touches = journal.ForEachTouch(session.name, [&](const session::JournalTouch& touch) {
      const auto series = journal.Series(session.name, touch.id);
      absl::StrAppend(&text, touch.id, " ", static_cast<int>(touch.stage), " ", touch.attempt, " ",
                      touch.program_id, " ", touch.error, " ",
                      touch.result.fingers.empty() ? 0 : touch.result.fingers[0].contact_time_s, " ",
                      !series.ok()          ? series.status().ToString()
                      : series->has_value() ? Sha256Hex((*series)->columns)
                                            : "",
                      "\n");
      return true;
    });
    const absl::Status images = journal.ForEachImage(session.name, [&](const session::JournalImage& image) {
      absl::StrAppend(&text, "picture ", image.id, " ", Sha256Hex(image.png), "\n");
      return true;
    });
    if (!touches.ok() || !images.ok()) absl::StrAppend(&text, touches.ToString(), images.ToString());
  }
  const auto deleted = journal.DeletedSessions();
  absl::StrAppend(&text, "in the trash ", deleted.ok() ? deleted->size() : 999, ", stop ",
                  journal.Metadata("stop").value_or("unreadable"));
  return text;
}

absl::StatusOr<std::unique_ptr<Journal>> Open(const std::string& path) {
  return Journal::Open(path, Journal::Mode::kCreateOrReadWrite);
}

class FailingJournals : public FailingFiles {
 protected:
  FailingJournals() {
    void* shared = mmap(nullptr, sizeof(int), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    acknowledged_ = new (shared) std::atomic<int>(0);
    const auto journal = Open(Path()).value();
    texts_.push_back(TextOf(*journal));
    for (const Step& step : Steps()) {
      const absl::Status done = step.run(journal.get());
      EXPECT_TRUE(done.ok()) << step.name << ": " << done;
      texts_.push_back(TextOf(*journal));
    }
    Clear();
  }
  ~FailingJournals() override { munmap(acknowledged_, sizeof(int)); }

  std::string Path() const { return Out("rig.db"); }
  void OpenOnce() { ASSERT_TRUE(Open(Path()).ok()); }

  // The rest of the steps, from one on, on a disk that is well again.
  void GoOn(Journal* journal, size_t from) {
    for (size_t k = from; k < Steps().size(); ++k) {
      const absl::Status done = Steps()[k].run(journal);
      ASSERT_TRUE(done.ok()) << Steps()[k].name << ": " << done;
    }
    EXPECT_EQ(TextOf(*journal), texts_.back());
  }

  void CheckRefusal(const absl::Status& refused) {
    EXPECT_THAT(std::string(refused.message()), testing::HasSubstr(Path()));
    EXPECT_THAT(std::string(refused.message()),
                testing::AnyOf(testing::HasSubstr(std::strerror(plan_->error)), testing::HasSubstr("full")));
  }

  // In this process, which lives on. False: no call was left to fail.
  bool LivesOn(const Fault& fault, int call) {
    Clear();
    Set(fault, call);
    absl::StatusOr<std::unique_ptr<Journal>> journal = Open(Path());
    if (!journal.ok()) {
      plan_->fails_at = 0;
      journal = Open(Path());
    }
    EXPECT_TRUE(journal.ok()) << journal.status();
    if (!journal.ok()) return false;
    size_t k = 0;
    for (; k < Steps().size(); ++k) {
      const absl::Status done = Steps()[k].run(journal->get());
      if (done.ok()) continue;
      plan_->fails_at = 0;
      CheckRefusal(done);
      EXPECT_EQ(TextOf(**journal), texts_[k]) << Steps()[k].name << " left a trace: " << done;
      break;
    }
    const bool reached = plan_->calls >= call;
    plan_->fails_at = 0;
    GoOn(journal->get(), k);
    *journal = nullptr;
    const auto again = Open(Path());
    EXPECT_TRUE(again.ok()) << again.status();
    if (again.ok()) {
      EXPECT_EQ(TextOf(**again), texts_.back());
    }
    return reached;
  }

  // In another process, which ends at what fails: without closing anything, as it is killed.
  bool Ends(const Fault& fault, int call) {
    Clear();
    Set(fault, call);
    *acknowledged_ = -1;
    (void)InChild([&]() -> absl::Status {
      const auto journal = Open(Path());
      if (!journal.ok()) _exit(1);
      *acknowledged_ = 0;
      for (const Step& step : Steps()) {
        if (!step.run(journal->get()).ok()) _exit(1);
        ++*acknowledged_;
      }
      _exit(0);
    });
    const bool reached = plan_->calls >= call;
    plan_->fails_at = 0;
    const auto journal = Open(Path());
    EXPECT_TRUE(journal.ok()) << journal.status();
    if (!journal.ok()) return false;
    const size_t done = static_cast<size_t>(std::max<int>(*acknowledged_, 0));
    const std::string found = TextOf(**journal);
    // The last one may have reached the disk before its answer.
    const bool one_more = found != texts_[done];
    EXPECT_TRUE(!one_more || (done + 1 < texts_.size() && found == texts_[done + 1]))
        << found << "\nacknowledged was\n"
        << texts_[done];
    if (!HasFailure()) GoOn(journal->get(), done + one_more);
    return reached;
  }

  void EveryCall(int stride) {
    for (const Fault& fault : kFaults)
      for (int call = 1; call < kMaxCalls; call += stride) {
        SCOPED_TRACE(absl::StrCat(fault.name, " at call ", call));
        // What a kill leaves must also be whole after a failure that was told.
        const bool lives = fault.mode != FailureMode::kKill && LivesOn(fault, call);
        const bool ends = Ends(fault, call);
        if (HasFailure()) FAIL() << plan_->failed;
        if (!lives && !ends) break;
        ++runs_;
      }
    RecordProperty("runs", runs_);
    EXPECT_GT(runs_, 20);
  }

  std::vector<std::string> texts_;  // before every step, and after the last
  std::atomic<int>* acknowledged_;  // steps; -1: the journal was not opened
  int runs_ = 0;
};

TEST_F(FailingJournals, KeepWhatIsAcknowledgedAndGoOn) {
  EveryCall(23);
}

TEST_F(FailingJournals, KeepWhatIsAcknowledgedWhicheverCallFails) {
  TOUCHSTONE_SECOND_TIER("repeated: every call instead of some");
  EveryCall(1);
}

}  // namespace
}  // namespace touchstone::faults
