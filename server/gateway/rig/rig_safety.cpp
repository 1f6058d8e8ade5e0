// What closes the latch of Stop without anybody's call: what the arm does by itself (arm_watch.h), and motions that were
// under way when a gateway ended.
#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_split.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <ctime>

#include "server/base/status.h"
#include "server/base/units.h"
#include "server/gateway/arm/ur_modes.h"
#include "server/gateway/rig/rig.h"

namespace touchstone::gateway {
namespace {

constexpr double kSafetyLookS = 0.02;  // host time between two looks; no state in between is missed
constexpr double kWriteAgainS =
    0.5;  // host time between two tries to write what the journal's disk did not take
constexpr double kArmAnswersS = 10;  // host time that the arm gets at the start
constexpr double kProgramEndsS = 5;  // host time that a program gets to end after a stop
constexpr size_t kMaxReasonBytes = 1000;

std::string UtcNow() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm parts{};
  char text[32] = "";
  if (::gmtime_r(&now, &parts) != nullptr) std::strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S UTC", &parts);
  return text;
}

std::string PlaceOf(const arm::ArmState& state) {
  const Eigen::Vector3d mm = state.base_from_tip.translation() * kMillimetresPerMetre;
  return absl::StrFormat("the tip stands at %.1f, %.1f, %.1f mm of the base", mm.x(), mm.y(), mm.z());
}

}  // namespace

void Rig::Latch(const std::string& what) {
  SayWhy(what);
  stopped_ = true;
  ++stops_;
  parts_.changes->Notify();
  std::string all;
  {
    std::lock_guard<std::mutex> lock(stop_mutex_);
    // A reset that was under way may have released it since.
    stopped_ = true;
    const std::string dated = absl::StrCat(what, " at ", UtcNow());
    if (stop_reason_.empty())
      stop_reason_ = dated;
    else if (stop_reason_.find(what) == std::string::npos &&
             stop_reason_.size() + dated.size() < kMaxReasonBytes)
      absl::StrAppend(&stop_reason_, "; then ", dated);
    all = stop_reason_;
    const absl::Status kept = unwritten_.SetFacts({{kStopKey, stop_reason_}}, true);
    if (!kept.ok()) spdlog::error("journal: {}", std::string(kept.message()));
  }
  SayWhy("");
  spdlog::warn("the rig is stopped {}; touchstone rig reset releases it", all);
}

void Rig::SayWhy(const std::string& what) {
  std::lock_guard<std::mutex> lock(stopping_mutex_);
  if (what.empty() || stopping_.empty()) stopping_ = what;
}

void Rig::LatchLoss(const std::string& what) {
  Latch(absl::StrCat("by the loss of the arm's controller (", what, ")"));
}

void Rig::LookAtSafety(bool asked) {
  std::lock_guard<std::mutex> lock(safety_mutex_);
  for (const std::string& what : watch_.Look(*parts_.arm, {motions_ > 0, powering_, asked})) {
    Latch(absl::StrCat("by the arm's controller (", what, ")"));
    audit().Write("latched", {{"what", what}}).IgnoreError();
  }
  EndPausedProgram();
}

void Rig::EndPausedProgram() {
  constexpr double kAgainS = 1;  // host time
  const absl::StatusOr<arm::ArmState> now = parts_.arm->State();
  if (motions_ > 0 || given_up_ == 0 || !now.ok() || now->program_id != given_up_ ||
      now->runtime_state != arm::RuntimeState::kPaused || NowS() - paused_stop_s_ < kAgainS)
    return;
  paused_stop_s_ = NowS();
  const absl::Status ended = parts_.arm->Stop();
  spdlog::warn("program {}, which was given up, is paused on the controller and is ended: {}",
               now->program_id, ended.ok() ? "sent" : std::string(ended.message()));
}

void Rig::WatchSafety() {
  double wrote_s = NowS();
  std::unique_lock<std::mutex> lock(watch_mutex_);
  while (!ending_) {
    lock.unlock();
    LookAtSafety();
    if (NowS() - wrote_s >= kWriteAgainS) {
      unwritten_.Flush();
      wrote_s = NowS();
    }
    lock.lock();
    options_.clock->WaitFor(lock, watch_ends_, kSafetyLookS, [this] { return ending_; });
  }
}

absl::Status Rig::LatchInterruption() {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto unfinished, journal().Unfinished());
  for (const auto& [session, touch] : unfinished)
    if (touch.stage == session::TouchStage::kExecuting)
      TOUCHSTONE_RETURN_IF_ERROR(LatchUnlessItEnded(
          touch.program_id, absl::StrCat("touch '", touch.id, "' of session '", session, "'")));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string motion, journal().Metadata(kMotionKey));
  // Nothing that was found is forgotten below before the latch is on the disk.
  if (motion.empty()) return unwritten_.SetFacts({}, false);
  const std::pair<std::string, std::string> parts = absl::StrSplit(motion, absl::MaxSplits(' ', 1));
  uint32_t program_id = 0;
  if (!absl::SimpleAtoi(parts.first, &program_id))
    return absl::DataLossError(absl::StrCat("the journal's ", kMotionKey, " is '", motion,
                                            "': a program's id and what it did were expected"));
  // Releasing brakes has no program that could say how far it came.
  if (program_id == 0) {
    Latch(absl::StrCat("by the start of the gateway (", parts.second,
                       " was under way when the gateway ended)"));
    audit().Write("latched", {{"what", parts.second}}).IgnoreError();
  } else {
    TOUCHSTONE_RETURN_IF_ERROR(LatchUnlessItEnded(program_id, parts.second));
  }
  // With the latch on the disk it need not be found again.
  return unwritten_.SetFacts({{kMotionKey, ""}}, false);
}

// Nothing hinges on what the controller's watchdog did when the heartbeats ceased: whether the program still runs, has
// ended in mid-way or at its end, and where the arm stands, is what the controller says now.
absl::Status Rig::LatchUnlessItEnded(uint32_t program_id, const std::string& what) {
  const auto state_once = [&](double patience_s, const std::function<bool(const arm::ArmState&)>& good) {
    absl::StatusOr<arm::ArmState> state = parts_.arm->State();
    for (const double until_s = NowS() + patience_s; (!state.ok() || !good(*state)) && NowS() < until_s;
         state = parts_.arm->State())
      parts_.changes->WaitForChange(parts_.changes->count(), 0.02);
    return state;
  };
  const auto rests = [](const arm::ArmState& state) {
    return state.runtime_state == arm::RuntimeState::kStopped;
  };
  absl::StatusOr<arm::ArmState> state = state_once(kArmAnswersS, [](const arm::ArmState&) { return true; });
  std::string found;
  if (!state.ok()) {
    found = absl::StrCat("the arm cannot be asked: ", state.status().message());
  } else {
    const bool ran = !rests(*state);
    given_up_ = program_id;
    if (ran) {
      parts_.arm->Stop().IgnoreError();
      state = state_once(kProgramEndsS, rests);
    }
    if (!state.ok()) {
      found = absl::StrCat("its program ran on and was stopped; then: ", state.status().message());
    } else {
      // Another program's id: this one never began. No id: the controller was started anew since, if it began.
      if (!ran && state->program_id != 0 &&
          (state->program_id != program_id || state->phase == arm::MotionPhase::kDone))
        return absl::OkStatus();
      found =
          absl::StrCat(state->runtime_state == arm::RuntimeState::kPaused ? "its program is paused"
                       : !rests(*state)                  ? "its program runs on although it was stopped"
                       : ran                             ? "its program ran on and was stopped"
                       : state->program_id != program_id ? "the controller knows nothing of its program"
                                                         : "its program had been ended (by the watchdog "
                                                           "for want of heartbeats, or at the teach pendant)",
                       ", phase '", arm::PhaseName(state->phase), "', safety mode ",
                       arm::SafetyModeName(state->safety_mode), ", ", PlaceOf(*state));
    }
  }
  const std::string text =
      absl::StrCat(what, ", program ", program_id, ", was under way when the gateway ended: ", found);
  Latch(absl::StrCat("by the start of the gateway (", text, ")"));
  audit().Write("latched", {{"what", text}}).IgnoreError();
  return absl::OkStatus();
}

}  // namespace touchstone::gateway
