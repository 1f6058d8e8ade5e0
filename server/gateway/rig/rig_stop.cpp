// Stopping the rig, what releases it, and what keeps it from moving.
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <chrono>

#include "server/base/status.h"
#include "server/gateway/arm/ur_modes.h"
#include "server/gateway/rig/rig.h"

namespace touchstone::gateway {

source::MotionGuard Rig::UntilStopped(const source::MotionGuard& caller) const {
  return [this, caller, stops = stops_.load()]() -> absl::Status {
    if (closing_) return absl::UnavailableError("the gateway is being shut down");
    if (stops_ == stops && !stopped_) return caller();
    const std::string reason = StopReason();
    // What has to be done first at the teach pendant comes first.
    if (const absl::StatusOr<arm::ArmState> arm = parts_.arm->State(); arm.ok())
      if (const absl::Status safety = arm::SafetyPermitsMotion(arm->safety_mode); !safety.ok())
        return absl::FailedPreconditionError(absl::StrCat(safety.message(), "; then release the stop",
                                                          reason.empty() ? "" : " ", reason,
                                                          " with 'touchstone rig reset'"));
    return absl::AbortedError(absl::StrCat("the rig was stopped", reason.empty() ? "" : " ", reason,
                                           ": make sure that it may move, then release the stop with "
                                           "'touchstone rig reset'"));
  };
}

absl::StatusOr<std::unique_lock<std::timed_mutex>> Rig::TakeRig(const source::MotionGuard& guard) {
  for (;;) {
    TOUCHSTONE_RETURN_IF_ERROR(guard());
    std::unique_lock<std::timed_mutex> lock(moving_, std::chrono::milliseconds(10));
    if (lock.owns_lock()) return lock;
  }
}

StopOutcome Rig::Stop(const std::string& reason, const std::string& who) {
  StopOutcome outcome;
  outcome.motions = motions_;
  const std::string words = absl::StrCat("by ", who, " (", reason, ")");
  SayWhy(words);
  stopped_ = true;
  ++stops_;
  const double stopped_s = ControllerNowS();
  const absl::Status status = parts_.arm->Stop();
  parts_.changes->Notify();
  if (!status.ok()) spdlog::error("stop: {}", std::string(status.message()));
  Latch(words);
  outcome.standstill = ConfirmStandstill(stopped_s);
  if (!outcome.standstill.ok()) spdlog::error("stop: {}", std::string(outcome.standstill.message()));
  audit()
      .Write("stop",
             {{"who", who},
              {"reason", reason},
              {"motions", absl::StrCat(outcome.motions)},
              {"sent", status.ok() ? "yes" : std::string(status.message())},
              {"standstill", outcome.standstill.ok() ? "yes" : std::string(outcome.standstill.message())}})
      .IgnoreError();
  return outcome;
}

void Rig::Close() {
  closing_ = true;
  if (motions_ > 0) Stop("the gateway was told to end while something moved", "the end of the gateway");
}

absl::Status Rig::Reset(const std::string& reason, const std::string& who) {
  LookAtSafety();  // what happened until now is what the person has seen
  const uint64_t stops = stops_;
  if (!stopped_) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const arm::ArmState arm, parts_.arm->State());
  if (const absl::Status safety = arm::SafetyPermitsMotion(arm.safety_mode); !safety.ok())
    return absl::FailedPreconditionError(
        absl::StrCat("the stop holds: ", safety.message(), "; then reset again"));
  {
    std::lock_guard<std::mutex> lock(stop_mutex_);
    if (stops_ != stops) return absl::AbortedError("the rig was stopped again meanwhile: the stop holds");
    // On the disk before anything may move.
    if (const absl::Status written = unwritten_.SetFacts({{kStopKey, ""}}, false); !written.ok()) {
      // It may have reached the disk although it says that it did not. SQLite would not write the same text over it.
      if (absl::EndsWith(stop_reason_, not_released_))
        stop_reason_.resize(stop_reason_.size() - not_released_.size());
      not_released_ =
          absl::StrCat("; not released at try ", ++failed_releases_, " (the journal's disk failed)");
      stop_reason_ += not_released_;
      unwritten_.SetFacts({{kStopKey, stop_reason_}}, true).IgnoreError();
      return written;
    }
    stop_reason_.clear();
    stopped_ = false;
  }
  audit().Write("reset", {{"who", who}, {"reason", reason}}).IgnoreError();
  return absl::OkStatus();
}

std::string Rig::StopReason() const {
  {
    std::lock_guard<std::mutex> lock(stopping_mutex_);
    if (!stopping_.empty()) return stopping_;
  }
  std::lock_guard<std::mutex> lock(stop_mutex_);
  return stop_reason_;
}

source::SourceState Rig::State() const {
  const absl::StatusOr<arm::ArmState> arm = parts_.arm->State();
  if (!arm.ok()) return source::SourceState::kDisconnected;
  switch (arm::KindOf(arm->safety_mode)) {
    case arm::SafetyKind::kPermitsMotion:
      break;
    case arm::SafetyKind::kProtectiveStop:
      return source::SourceState::kProtectiveStop;
    case arm::SafetyKind::kRecovery:
      return source::SourceState::kRecovery;
    case arm::SafetyKind::kSafeguard:
      return source::SourceState::kSafeguardStop;
    case arm::SafetyKind::kEmergencyStop:
      return source::SourceState::kEmergencyStop;
    case arm::SafetyKind::kFault:
      return source::SourceState::kFault;
  }
  if (stopped_) return source::SourceState::kStopped;
  if (arm->robot_mode != arm::RobotMode::kRunning) return source::SourceState::kPoweredOff;
  if (!parts_.effector->State().connected) return source::SourceState::kDisconnected;
  return motions_ > 0 ? source::SourceState::kBusy : source::SourceState::kIdle;
}

}  // namespace touchstone::gateway
