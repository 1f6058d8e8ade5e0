// After an interruption: what became of the touches that were under way. Nothing is moved or repeated here.
#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "server/base/status.h"
#include "server/gateway/arm/ur_modes.h"
#include "server/gateway/rig/results/touch_result.h"
#include "server/gateway/rig/rig.h"

namespace touchstone::gateway {
namespace {

// Host time that the arm and the end effector get to answer before a touch is given up.
constexpr double kPatienceS = 10;

}  // namespace

absl::Status Rig::Reconcile() {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto unfinished, journal().Unfinished());
  for (const auto& [session, touch] : unfinished) {
    TOUCHSTONE_RETURN_IF_ERROR(ReconcileTouch(session, touch));
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::optional<session::JournalTouch> now,
                                journal().Find(session, touch.id));
    const bool recovered = now.has_value() && now->stage == session::TouchStage::kDone;
    ++(recovered ? status_.recovered_touches : status_.interrupted_touches);
    const std::string outcome = recovered         ? "its result was recovered"
                                : now.has_value() ? now->error
                                                  : "it is gone";
    spdlog::warn("touch '{}' of session '{}' was under way: {}", touch.id, session, outcome);
    audit().Write("reconciled", {{"session", session}, {"id", touch.id}, {"outcome", outcome}}).IgnoreError();
  }
  return absl::OkStatus();
}

absl::Status Rig::ReconcileTouch(const std::string& session, const session::JournalTouch& touch) {
  if (touch.stage == session::TouchStage::kIntent)
    return journal().Failed(session, touch.id, "interrupted before anything moved");

  // Its program must not run any more: the arm's own watchdog has ended it, or this does.
  const double give_up_s = NowS() + kPatienceS;
  absl::StatusOr<arm::ArmState> arm = parts_.arm->State();
  while ((!arm.ok() || !parts_.effector->State().connected) && NowS() < give_up_s) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    arm = parts_.arm->State();
  }
  if (!arm.ok())
    return journal().Failed(
        session, touch.id,
        absl::StrCat("interrupted, and the arm cannot be asked: ", arm.status().message()));
  if (arm->runtime_state == arm::RuntimeState::kPlaying) parts_.arm->Stop().IgnoreError();

  // Contact times stand only if the approach ended as it should: by command or at its stroke, never by the
  // watchdog in mid-way. The program's own registers say which.
  if (arm->program_id != touch.program_id || arm->phase < arm::MotionPhase::kRetract)
    return journal().Failed(session, touch.id,
                            absl::StrCat("interrupted during '", arm::PhaseName(arm->phase), "' of program ",
                                         arm->program_id, "; it can be made again under the same id"));
  const absl::StatusOr<effector::EffectorTouch> contacts = parts_.effector->Recall(touch.program_id);
  if (!contacts.ok())
    return journal().Failed(
        session, touch.id,
        absl::StrCat("interrupted, and the end effector has no record of it: ", contacts.status().message()));
  if (contacts->boot_id != touch.boot_id || contacts->Contacts() == 0)
    return journal().Failed(
        session, touch.id,
        "interrupted, and the end effector was reset since; it can be made again under the same id");
  // On its way back a finger may be pressed still.
  if (const absl::Status released = CheckReleased(*contacts);
      arm->phase == arm::MotionPhase::kDone && !released.ok())
    return journal().Failed(session, touch.id, absl::StrCat("interrupted: ", released.message()));
  TouchRecording record;
  record.motion.program_id = touch.program_id;
  record.motion.transit = {Eigen::Isometry3d::Identity()};
  record.motion.end = Eigen::Isometry3d(Eigen::Translation3d(0, 0, 1));
  record.time_scale = options_.time_scale;
  record.recovered = true;
  record.tick_hz = std::max<uint32_t>(1, parts_.effector->State().tick_hz);
  record.contacts = *contacts;
  record.contacts.contact_ticks.resize(options_.fingers);
  record.effector_clock = parts_.effector->Clock();
  TOUCHSTONE_ASSIGN_OR_RETURN(session::JournalResult result, ResultOf(record));
  result.recovered = true;
  TOUCHSTONE_ASSIGN_OR_RETURN(result.session_time_s, session_clock_.NowS(session));
  return journal().Done(session, touch.id, result);
}

}  // namespace touchstone::gateway
