// A rig whose journal's disk fails at each of its calls in turn: nothing moves while its latch is closed, and the latch is still
// closed in the process after it.
#include <absl/strings/str_cat.h>

#include <atomic>
#include <future>
#include <thread>

#include "server/base/test_tier.h"
#include "server/base/threads/clock.h"
#include "server/gateway/audit/audit_log.h"
#include "server/gateway/rig/idle_effector.h"
#include "server/gateway/rig/rig.h"
#include "server/gateway/rig/watches/scripted_arm.h"
#include "tests/faults/preloaded/failing_test.h"

namespace touchstone::faults {
namespace {

using gateway::Rig;
using gateway::RigParts;
using gateway::ScriptedArm;

absl::Status Allowed() {
  return absl::OkStatus();
}

bool WaitFor(const std::function<bool()>& done) {
  for (const double until_s = SteadyClock().NowS() + 30; SteadyClock().NowS() < until_s;) {
    if (done()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return false;
}

// What a process that was killed since saw of its rig.
struct Seen {
  std::atomic<bool> started, moved, latched, on_disk, released, refuses, reached;
};

class FailingRigs : public FailingFiles {
 protected:
  FailingRigs() {
    void* shared = mmap(nullptr, sizeof(Seen), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    seen_ = new (shared) Seen{};
  }
  ~FailingRigs() override { munmap(seen_, sizeof(Seen)); }

  absl::StatusOr<std::unique_ptr<session::Journal>> OpenJournal() const {
    return session::Journal::Open(Out("rig.db"), session::Journal::Mode::kCreateOrReadWrite);
  }

  absl::Status Start() {
    RigParts parts;
    auto journal = OpenJournal();
    if (!journal.ok()) return journal.status();
    parts.journal = *std::move(journal);
    auto audit = gateway::audit::AuditLog::Open(Out("audit.jsonl"));
    if (!audit.ok()) return audit.status();
    parts.audit = *std::move(audit);
    parts.changes = std::make_unique<gateway::timing::ChangeNotifier>();
    auto arm = std::make_unique<ScriptedArm>(parts.changes.get());
    arm_ = arm.get();
    parts.arm = std::move(arm);
    parts.effector = std::make_unique<gateway::IdleEffector>();
    parts.planner = gateway::arm::MotionPlanner::Create("ur3e", gateway::arm::MotionLimits(),
                                                        gateway::calibration::Calibration())
                        .value();
    auto rig = Rig::Create({}, std::move(parts));
    if (!rig.ok()) return rig.status();
    rig_ = *std::move(rig);
    return absl::OkStatus();
  }
  void End() {
    rig_ = nullptr;
    arm_ = nullptr;
  }

  void SeeALatch() {
    seen_->latched = WaitFor([&] { return !rig_->StopReason().empty(); });
    arm_->SetSafety(gateway::arm::SafetyMode::kNormal);
    arm_->SetLink(absl::OkStatus());
    const int programs = arm_->programs;
    seen_->refuses = absl::IsAborted(rig_->Home(Allowed)) && arm_->programs == programs;
  }

 public:
  // --- What happens to a rig, each in a process of its own

  void BeStoppedBetweenMotions() {
    arm_->SetSafety(gateway::arm::SafetyMode::kProtectiveStop);
    SeeALatch();
  }
  void BePausedInAMotion() {
    BreakAMotionOff([&] {
      arm_->Change(
          [](gateway::arm::ArmState* state) { state->runtime_state = gateway::arm::RuntimeState::kPausing; });
    });
  }
  void LoseTheLinkInAMotion() {
    BreakAMotionOff([&] { arm_->SetLink(absl::UnavailableError("the link is down")); });
  }
  void BeStoppedAndReleased() {
    rig_->Stop("a test", "ana");
    seen_->latched = true;
    seen_->released = rig_->Reset("looked", "ana").ok();
    seen_->refuses = seen_->released || absl::IsAborted(rig_->Home(Allowed));
  }

 protected:
  void BreakAMotionOff(const std::function<void()>& how) {
    auto homing = std::async(std::launch::async, [&] { return rig_->Home(Allowed); });
    const auto ended = [&] { return homing.wait_for(std::chrono::seconds(0)) == std::future_status::ready; };
    WaitFor([&] { return arm_->motions == 1 || ended(); });
    if (arm_->motions == 0) return;
    seen_->moved = true;
    how();
    homing.wait();
    SeeALatch();
  }

  // Waits for the latch on the disk, which a disk that is well lets the rig do.
  bool IsOnTheDisk() {
    return WaitFor([&] {
      const auto journal = session::Journal::Open(Out("rig.db"), session::Journal::Mode::kReadOnly);
      return journal.ok() && !(*journal)->Metadata("stop").value_or("").empty();
    });
  }

  using Story = void (FailingRigs::*)();

  void LiveThrough(const Fault& fault, int call, Story story) {
    Clear();
    new (seen_) Seen{};
    (void)OpenJournal();
    Set(fault, call);
    (void)InChild([&]() -> absl::Status {
      if (const absl::Status started = Start(); !started.ok()) _exit(1);
      seen_->started = true;
      (this->*story)();
      seen_->reached = plan_->calls >= call;
      if (fault.mode != FailureMode::kFromThenOn && seen_->latched && !seen_->released)
        seen_->on_disk = IsOnTheDisk();
      raise(SIGKILL);
      return absl::OkStatus();
    });
    plan_->fails_at = 0;
  }

  bool IsLatchedAtTheNextStart() {
    const absl::Status started = Start();
    EXPECT_TRUE(started.ok()) << started;
    const bool latched = started.ok() && !rig_->StopReason().empty();
    End();
    return latched;
  }

  void EveryCall(Story story, int stride) {
    int runs = 0;
    for (const Fault& fault : kFaults)
      for (int call = 1; call < kMaxCalls; call += stride) {
        LiveThrough(fault, call, story);
        SCOPED_TRACE(absl::StrCat(fault.name, " at call ", call, ": ", plan_->failed));
        const bool killed = fault.mode == FailureMode::kKill;
        if (seen_->latched && (!killed || seen_->reached)) {
          EXPECT_TRUE(seen_->refuses) << "it moves although it is latched";
        }
        const bool latched = IsLatchedAtTheNextStart();
        // A latch between motions that no disk took until the end of the process is nowhere, and a kill may come between
        // the latch and the disk; one of a motion is, since what moves was on the disk before. A release that failed may have
        // reached the disk.
        const bool told =
            killed ? seen_->on_disk.load() : fault.mode != FailureMode::kFromThenOn && seen_->latched;
        if (seen_->moved || (told && !seen_->released)) {
          EXPECT_TRUE(latched) << "the latch is gone";
        }
        if (seen_->released) {
          EXPECT_FALSE(latched) << "the release is gone";
        }
        if (HasFailure()) return;
        ++runs;
        if (seen_->started && plan_->calls < call) break;
      }
    EXPECT_GT(runs, 10);
  }

  Seen* seen_;
  std::unique_ptr<Rig> rig_;
  ScriptedArm* arm_ = nullptr;
};

// The first tier leaves calls out.
int Stride() {
  return SecondTierRuns() ? 1 : 9;
}

TEST_F(FailingRigs, StayLatchedAfterAStopBetweenMotions) {
  EveryCall(&FailingRigs::BeStoppedBetweenMotions, Stride());
}

TEST_F(FailingRigs, StayLatchedAfterAMotionThatWasPaused) {
  EveryCall(&FailingRigs::BePausedInAMotion, Stride());
}

TEST_F(FailingRigs, StayLatchedAfterALinkWasLostInAMotion) {
  TOUCHSTONE_SECOND_TIER("repeated: another end of a motion");
  EveryCall(&FailingRigs::LoseTheLinkInAMotion, Stride());
}

TEST_F(FailingRigs, StayLatchedUntilTheReleaseIsOnTheDisk) {
  EveryCall(&FailingRigs::BeStoppedAndReleased, Stride());
}

// --- The audit log

TEST_F(FailingFiles, AppendToAnAuditLogWholeLinesOrSayWhy) {
  for (const Fault& fault : kFaults) {
    if (fault.mode == FailureMode::kKill) continue;
    for (int call = 1; call < 30; ++call) {
      Clear();
      Set(fault, call);
      auto log = gateway::audit::AuditLog::Open(Out("audit.jsonl"));
      if (!log.ok()) {
        EXPECT_THAT(std::string(log.status().message()), testing::HasSubstr("audit.jsonl"));
        plan_->fails_at = 0;
        log = gateway::audit::AuditLog::Open(Out("audit.jsonl"));
      }
      ASSERT_TRUE(log.ok()) << log.status();
      std::vector<std::string> acknowledged;
      for (int k = 0; k < 6; ++k) {
        const std::string event = absl::StrCat("event_", k);
        const absl::Status written = (*log)->Write(event, {});
        if (written.ok())
          acknowledged.push_back(event);
        else
          EXPECT_THAT(std::string(written.message()), testing::HasSubstr("audit.jsonl"));
        if (k == 3) plan_->fails_at = 0;
      }
      std::ifstream file(Out("audit.jsonl"));
      std::string whole;
      for (std::string line; std::getline(file, line);)
        if (!line.empty() && line.back() == '}') absl::StrAppend(&whole, line, "\n");
      for (const std::string& event : acknowledged)
        EXPECT_THAT(whole, testing::HasSubstr(absl::StrCat("\"", event, "\"}\n")))
            << fault.name << " at call " << call << ": " << plan_->failed;
    }
  }
}

}  // namespace
}  // namespace touchstone::faults
