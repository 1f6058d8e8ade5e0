// One touch from its program to its result, and the watch over everything that moves.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/text.h"
#include "server/gateway/arm/ur_modes.h"
#include "server/gateway/rig/force_guard.h"
#include "server/gateway/rig/rig.h"
#include "server/gateway/rig/touch_result.h"
#include "server/gateway/rig/touch_series.h"
#include "server/session/touch_series.h"

namespace touchstone::gateway {
namespace {

constexpr double kLookPeriodS = 0.01;  // host time; how soon a lost lease is noticed
constexpr double kHungS = 0.4;         // host time between two looks in which heartbeats may have ceased
constexpr double kAfterHangS = 1;      // host time after it in which a failure may come of it
constexpr double kProgramStartsS = 2;  // host time that a program may take until its phase is reported

}  // namespace

absl::Status Rig::Supervise(uint32_t program_id, double limit_s, const char* what,
                            const source::MotionGuard& guard,
                            const std::function<absl::StatusOr<bool>(const arm::ArmState&)>& done,
                            std::optional<double> max_force_n) {
  const double began_s = NowS();
  double at_rest_since_s = 0;
  bool seen = false;  // the program's phase was reported
  double looked_s = began_s, hung_s = 0, hung_at_s = 0;
  const auto look_for_hang = [&](double now_s) {
    if (now_s - looked_s > kHungS) hung_s = now_s - looked_s, hung_at_s = now_s;
    looked_s = now_s;
  };
  ForceGuard force(*parts_.arm, max_force_n.value_or(parts_.planner->limits().max_force_n), what);
  // Whatever ends the watch before it is done stops the arm first.
  const auto give_up = [&](absl::Status status) {
    look_for_hang(NowS());
    const absl::Status stop = parts_.arm->Stop();
    // Whether the watchdog had ended the program before cannot be told any more.
    if (hung_s > 0 && NowS() - hung_at_s < kAfterHangS)
      Latch(absl::StrCat("by the gateway (it hung for ", ShortestNumber(std::round(10 * hung_s) / 10),
                         " s during ", what, ", program ", program_id, ")"));
    if (!stop.ok())
      status = absl::Status(status.code(), absl::StrCat(status.message(), " (and: ", stop.message(), ")"));
    return status;
  };
  for (;;) {
    const uint64_t changes = parts_.changes->count();
    const double now_s = NowS();
    look_for_hang(now_s);
    if (const absl::Status may = MayGoOn(guard); !may.ok()) return give_up(may);
    const absl::StatusOr<arm::ArmState> state = parts_.arm->State();
    if (!state.ok()) return give_up(state.status());
    if (const absl::Status light = force.Check(*state); !light.ok()) return give_up(light);
    seen = seen || state->program_id == program_id;
    if (seen) {
      const absl::StatusOr<bool> over = done(*state);
      if (!over.ok()) return give_up(over.status());
      if (*over) return absl::OkStatus();
    }

    // A program that ended by itself, or never began.
    const bool rests = state->runtime_state == arm::RuntimeState::kStopped && now_s - began_s > 0.5;
    at_rest_since_s = !rests ? 0 : at_rest_since_s == 0 ? now_s : at_rest_since_s;
    if (seen && rests && now_s - at_rest_since_s > 0.5) {
      const std::string ended = absl::StrCat("the arm's program ", program_id, " ended during ", what,
                                             " at phase '", arm::PhaseName(state->phase), "'");
      Latch(absl::StrCat("by the arm's controller (", ended,
                         ": its watchdog, the teach pendant or another program ended it)"));
      return give_up(absl::UnavailableError(ended));
    }
    if (!seen && now_s - began_s > kProgramStartsS + 1)
      return give_up(
          absl::UnavailableError(absl::StrCat("the arm never began program ", program_id, " (", what,
                                              "): is it in remote control, and no pop-up open?")));
    if (now_s - began_s > limit_s)
      return give_up(absl::UnavailableError(absl::StrCat(
          what, " took longer than ", ShortestNumber(std::round(limit_s)), " s and was stopped")));
    parts_.changes->WaitForChange(changes, kLookPeriodS);
  }
}

absl::Status Rig::MayGoOn(const source::MotionGuard& guard) {
  heartbeats_->Permit();
  // The controller's own stop first: it says more than that the latch has closed because of it.
  if (const absl::StatusOr<arm::ArmState> state = parts_.arm->State(); state.ok()) {
    if (const absl::Status safety = arm::SafetyPermitsMotion(state->safety_mode); !safety.ok()) {
      LookAtSafety();
      return safety;
    }
  }
  return guard();
}

absl::StatusOr<session::JournalResult> Rig::MakeTouch(const arm::PlannedTouch& plan, uint32_t program_id,
                                                      const source::TouchCommand& command,
                                                      const source::MotionGuard& guard,
                                                      std::optional<session::JournalSeries>* series) {
  TouchRecording record;
  record.motion = plan.motion;
  record.motion.program_id = program_id;
  record.acceleration_m_s2 = parts_.planner->limits().acceleration_m_s2;
  record.time_scale = options_.time_scale;
  const double host_per_rig = 1 / options_.time_scale;
  const double limit_s = 2 * plan.motion.duration_s * host_per_rig + 15;
  const auto phase_is = [](arm::MotionPhase phase) {
    return [phase](const arm::ArmState& state) -> absl::StatusOr<bool> { return state.phase == phase; };
  };

  // To the start. The capture begins there, at rest and with every finger free.
  const HeartbeatScope beating(heartbeats_.get());
  TOUCHSTONE_RETURN_IF_ERROR(parts_.arm->StartTouch(record.motion, guard));
  TOUCHSTONE_RETURN_IF_ERROR(
      Supervise(program_id, limit_s, "the transit to the start", guard, phase_is(arm::MotionPhase::kReady)));
  if (const absl::Status started = parts_.effector->StartCapture(program_id, [&] { return MayGoOn(guard); });
      !started.ok()) {
    parts_.arm->Stop().IgnoreError();
    return started;
  }

  // The approach: until every finger has reported, the first one is pushed far enough, or the stroke ends.
  if (const absl::Status began = parts_.arm->BeginApproach(program_id, guard); !began.ok()) {
    parts_.arm->Stop().IgnoreError();
    return began;
  }
  const Eigen::Vector3d approach =
      (plan.motion.end.translation() - plan.motion.transit.back().translation()).normalized();
  bool ended = false;
  std::optional<double> pressed_from_m;
  TOUCHSTONE_RETURN_IF_ERROR(Supervise(
      program_id, limit_s, "the approach", guard, [&](const arm::ArmState& state) -> absl::StatusOr<bool> {
        if (state.phase == arm::MotionPhase::kDone) return true;
        TOUCHSTONE_ASSIGN_OR_RETURN(const effector::EffectorTouch contacts, parts_.effector->Touch());
        const int count = contacts.Contacts();
        const double distance_m = approach.dot(state.base_from_tip.translation());
        if (count > 0 && !pressed_from_m.has_value()) pressed_from_m = distance_m;
        const bool pressed =
            pressed_from_m.has_value() && distance_m - *pressed_from_m > options_.max_overtravel_m;
        if (!ended && (count == options_.fingers || pressed)) {
          TOUCHSTONE_RETURN_IF_ERROR(parts_.arm->EndApproach(program_id));
          ended = true;
        }
        return false;
      }));

  // The arm's states are kept for half a minute only, and a line that loses frames may take its time below.
  TOUCHSTONE_ASSIGN_OR_RETURN(const arm::ArmState now, parts_.arm->State());
  const double span_s = plan.motion.duration_s + 5 * options_.time_scale;
  record.states = parts_.arm->History(now.controller_time_s - span_s, now.controller_time_s);

  // A finger without contact is certain only after the capture has ended and the device's record was read.
  TOUCHSTONE_RETURN_IF_ERROR(parts_.effector->EndCapture());
  TOUCHSTONE_ASSIGN_OR_RETURN(record.contacts, parts_.effector->Touch());
  TOUCHSTONE_RETURN_IF_ERROR(CheckReleased(record.contacts));
  record.contacts.contact_ticks.resize(options_.fingers);
  record.tick_hz = std::max<uint32_t>(1, parts_.effector->State().tick_hz);
  record.effector_clock = parts_.effector->Clock();
  record.controller_clock = parts_.arm->ControllerClock();
  record.unix_minus_host_s = timing::UnixNowS() - NowS();
  if (command.series) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::TouchSeries states, SeriesOf(record));
    *series = session::JournalSeries{session::kSeriesEncoding, states.SerializeAsString()};
  }
  return ResultOf(record);
}

}  // namespace touchstone::gateway
