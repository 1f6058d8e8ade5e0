// Stopping the rig, what releases it, and what keeps it from moving.
#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <chrono>

#include "server/base/status.h"
#include "server/gateway/arm/ur_modes.h"
#include "server/gateway/rig/rig.h"

namespace touchstone {

MotionGuard Rig::UntilStopped(const MotionGuard& caller) const {
  return [this, caller, stops = stops_.load()]() -> absl::Status {
    if (stops_ == stops && !stopped_) return caller();
    const std::string reason = StopReason();
    return absl::AbortedError(absl::StrCat("the rig was stopped", reason.empty() ? "" : " ", reason,
                                           ": make sure that it may move, then release the stop with "
                                           "'touchstone rig reset'"));
  };
}

absl::StatusOr<std::unique_lock<std::timed_mutex>> Rig::TakeRig(const MotionGuard& guard) {
  for (;;) {
    TOUCHSTONE_RETURN_IF_ERROR(guard());
    std::unique_lock<std::timed_mutex> lock(moving_, std::chrono::milliseconds(10));
    if (lock.owns_lock()) return lock;
  }
}

uint32_t Rig::Stop(const std::string& reason, const std::string& who) {
  const uint32_t motions = motions_;
  stopped_ = true;
  ++stops_;
  const absl::Status status = parts_.arm->Stop();
  parts_.changes->Notify();
  if (!status.ok()) spdlog::error("stop: {}", std::string(status.message()));
  {
    std::lock_guard<std::mutex> lock(stop_mutex_);
    // A reset that was under way may have released it since.
    stopped_ = true;
    stop_reason_ = absl::StrCat("by ", who, " (", reason, ")");
    const absl::Status kept = journal().SetFact(kStopFact, stop_reason_);
    if (!kept.ok()) spdlog::error("journal: {}", std::string(kept.message()));
  }
  audit()
      .Write("stop", {{"who", who},
                      {"reason", reason},
                      {"motions", absl::StrCat(motions)},
                      {"sent", status.ok() ? "yes" : std::string(status.message())}})
      .IgnoreError();
  return motions;
}

absl::Status Rig::Reset(const std::string& reason, const std::string& who) {
  const uint64_t stops = stops_;
  if (!stopped_) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const ArmState arm, parts_.arm->State());
  if (const absl::Status safety = SafetyPermitsMotion(arm.safety_mode); !safety.ok())
    return absl::FailedPreconditionError(
        absl::StrCat("the stop holds: ", safety.message(), "; then reset again"));
  {
    std::lock_guard<std::mutex> lock(stop_mutex_);
    if (stops_ != stops) return absl::AbortedError("the rig was stopped again meanwhile: the stop holds");
    // On the disk before anything may move.
    TOUCHSTONE_RETURN_IF_ERROR(journal().SetFact(kStopFact, ""));
    stop_reason_.clear();
    stopped_ = false;
  }
  audit().Write("reset", {{"who", who}, {"reason", reason}}).IgnoreError();
  return absl::OkStatus();
}

std::string Rig::StopReason() const {
  std::lock_guard<std::mutex> lock(stop_mutex_);
  return stop_reason_;
}

SourceState Rig::State() const {
  const absl::StatusOr<ArmState> arm = parts_.arm->State();
  if (!arm.ok()) return SourceState::kDisconnected;
  switch (arm->safety_mode) {
    case SafetyMode::kNormal:
    case SafetyMode::kReduced:
      break;
    case SafetyMode::kProtectiveStop:
      return SourceState::kProtectiveStop;
    case SafetyMode::kRecovery:
      return SourceState::kRecovery;
    case SafetyMode::kSafeguardStop:
      return SourceState::kSafeguardStop;
    case SafetyMode::kSystemEmergencyStop:
    case SafetyMode::kRobotEmergencyStop:
      return SourceState::kEmergencyStop;
    default:
      return SourceState::kFault;
  }
  if (stopped_) return SourceState::kStopped;
  if (arm->robot_mode != RobotMode::kRunning) return SourceState::kPoweredOff;
  if (!parts_.effector->State().connected) return SourceState::kDisconnected;
  return motions_ > 0 ? SourceState::kBusy : SourceState::kIdle;
}

}  // namespace touchstone
