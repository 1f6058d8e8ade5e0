// The arm in a person's hands.
#include <absl/strings/str_cat.h>

#include <limits>

#include "server/base/status.h"
#include "server/gateway/rig/rig.h"

namespace touchstone::gateway {
namespace {

constexpr double kLongestGuideS = 4 * 3600;  // host time
constexpr double kGuideReportS = 0.05;       // host time between two reports

}  // namespace

absl::Status Rig::Guide(const std::function<void(const arm::ArmState&)>& report,
                        const source::MotionGuard& caller) {
  const source::MotionGuard guard = UntilStopped(caller);
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto lock, TakeRig(guard));
  TOUCHSTONE_RETURN_IF_ERROR(ReadyToMove(guard));
  TOUCHSTONE_ASSIGN_OR_RETURN(const uint32_t program_id, NextProgramId());
  TOUCHSTONE_RETURN_IF_ERROR(
      unwritten_.SetFacts({{kMotionKey, absl::StrCat(program_id, " a hand that guided the arm")}}, false));
  audit().Write("freedrive", {{"program", std::to_string(program_id)}}).IgnoreError();
  ++motions_;
  const HeartbeatScope beating(heartbeats_.get());
  // The hand may press as hard as it likes.
  Program program{program_id, guard, std::numeric_limits<double>::infinity()};
  absl::Status status = Launch(&program, "freedrive", [&](const arm::StartGuard& start) {
    return parts_.arm->StartFreedrive(program_id, start);
  });
  double reported_s = 0;
  // Whatever ends the watch stops the program, and with it freedrive.
  if (status.ok())
    status = Supervise(&program, kLongestGuideS, "freedrive",
                       [&](const arm::ArmState& state) -> absl::StatusOr<bool> {
                         const double now_s = NowS();
                         if (state.phase == arm::MotionPhase::kReady && now_s - reported_s >= kGuideReportS) {
                           reported_s = now_s;
                           report(state);
                         }
                         return state.phase == arm::MotionPhase::kDone;
                       });
  --motions_;
  TOUCHSTONE_RETURN_IF_ERROR(unwritten_.SetFacts({{kMotionKey, ""}}, true));
  audit().Write("freedrive_ended", {{"why", std::string(status.message())}}).IgnoreError();
  return status;
}

}  // namespace touchstone::gateway
