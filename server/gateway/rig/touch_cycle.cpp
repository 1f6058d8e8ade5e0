// One touch from its program to its result.

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/gateway/rig/results/touch_result.h"
#include "server/gateway/rig/results/touch_series.h"
#include "server/gateway/rig/rig.h"
#include "server/session/recorded/touch_series.h"

namespace touchstone::gateway {
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
  constexpr char kTransit[] = "the transit to the start", kApproach[] = "the approach";
  const HeartbeatScope beating(heartbeats_.get());
  Program program{program_id, guard, parts_.planner->limits().max_force_n};
  TOUCHSTONE_RETURN_IF_ERROR(Launch(&program, kTransit, [&](const arm::StartGuard& start) {
    return parts_.arm->StartTouch(record.motion, start);
  }));
  TOUCHSTONE_RETURN_IF_ERROR(Supervise(&program, limit_s, kTransit, phase_is(arm::MotionPhase::kReady)));
  if (const absl::Status started = parts_.effector->StartCapture(program_id, [&] { return MayGoOn(guard); });
      !started.ok())
    return GiveUp(&program, kTransit, started);

  // The approach: until every finger has reported, the first one is pushed far enough, or the stroke ends.
  if (const absl::Status began = parts_.arm->BeginApproach(program_id, guard); !began.ok())
    return GiveUp(&program, kApproach, began);
  const Eigen::Vector3d approach =
      (plan.motion.end.translation() - plan.motion.transit.back().translation()).normalized();
  bool ended = false;
  std::optional<double> pressed_from_m;
  TOUCHSTONE_RETURN_IF_ERROR(
      Supervise(&program, limit_s, kApproach, [&](const arm::ArmState& state) -> absl::StatusOr<bool> {
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
  TOUCHSTONE_RETURN_IF_ERROR(CheckHeld(record));
  if (command.series) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const v1::TouchSeries states, SeriesOf(record));
    *series = session::JournalSeries{session::kSeriesEncoding, states.SerializeAsString()};
  }
  return ResultOf(record);
}

}  // namespace touchstone::gateway
