// The watch over everything that moves: from a program's sending to its end, and what follows when it ends otherwise.
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/gateway/arm/ur_modes.h"
#include "server/gateway/rig/rig.h"
#include "server/gateway/rig/watches/force_guard.h"

namespace touchstone::gateway {
namespace {

constexpr double kLookPeriodS = 0.01;  // host time; how soon a lost lease is noticed
constexpr double kHungS = 0.4;         // host time between two looks in which heartbeats may have ceased
constexpr double kAfterHangS = 1;      // host time after it in which a failure may come of it
constexpr double kProgramStartsS = 2;  // host time that a program may take until its phase is reported
constexpr double kPreparedRestS =
    0.08;                        // rig time at rest before a program is let go, for the mean of the force
constexpr double kEndedS = 0.5;  // host time without a program after which ours has ended

// Of a stop, host time but for kStillS.
constexpr double kFirstWayS = 0.15, kStandstillS = 1.5;
constexpr double kStillS = 0.05;  // controller time over which the joints must not move
constexpr double kStillRad =
    3e-4;  // over that; noise of a standing joint is about 2.3e-5 (tests/rig/controller)
constexpr double kStillGapS = 10;  // controller time between two states that still tell of a standstill
constexpr double kGoneS = 0.3;     // without a state of the controller

bool IsPaused(arm::RuntimeState state) {
  return state == arm::RuntimeState::kPausing || state == arm::RuntimeState::kPaused ||
         state == arm::RuntimeState::kResuming;
}

}  // namespace

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

absl::Status Rig::Launch(Program* program, const char* what,
                         const std::function<absl::Status(const arm::StartGuard&)>& send) {
  // A motion that begins where the last one was broken off may begin pressed, to let go.
  const Eigen::Vector3d before_n = ForceAtRest(*parts_.arm, zeroed_n_);
  const double sent_s = ControllerNowS();
  const absl::Status at_rest = CheckForceAtRest(before_n, program->max_force_n);
  const bool pressed = !at_rest.ok();
  if (!left_pressed_) TOUCHSTONE_RETURN_IF_ERROR(at_rest);
  // The program's guard, and what it answered.
  const auto noting = [program](bool* allowed) {
    return [program, allowed] {
      absl::Status answer = program->guard();
      *allowed = *allowed || answer.ok();
      return answer;
    };
  };
  bool went_out = false;
  const absl::Status sent = send(noting(&went_out));
  if (!sent.ok()) return went_out ? GiveUp(program, what, sent) : sent;
  TOUCHSTONE_RETURN_IF_ERROR(
      Supervise(program, kProgramStartsS + 1, what, [&](const arm::ArmState& newest) -> absl::StatusOr<bool> {
        double first_s = newest.controller_time_s;
        int count = 0;
        Eigen::Vector3d sum_n = Eigen::Vector3d::Zero();
        for (const arm::ArmState& state : parts_.arm->History(sent_s, newest.controller_time_s)) {
          if (state.program_id != program->id) continue;
          first_s = std::min(first_s, state.controller_time_s);
          sum_n += state.tip_force_n, ++count;
        }
        // Also if the motion is given up here: the sensor was zeroed. Only what pressed counts: otherwise the noise of every
        // program would add up.
        zeroed_n_.setZero();
        if (pressed)
          zeroed_n_ = newest.base_from_tip.linear().transpose() * (before_n - sum_n / std::max(count, 1));
        return newest.controller_time_s - first_s >= kPreparedRestS;
      }));
  const absl::Status moves = parts_.arm->BeginMotion(program->id, noting(&program->let_go));
  return moves.ok() ? moves : GiveUp(program, what, moves);
}

absl::Status Rig::Supervise(Program* program, double limit_s, const char* what,
                            const std::function<absl::StatusOr<bool>(const arm::ArmState&)>& done) {
  const double began_s = NowS();
  double at_rest_since_s = 0, looked_s = began_s;
  bool seen = program->let_go;  // its id was reported
  // Of a program that has not been let go only the sensor's zero changes.
  ForceGuard force(*parts_.arm,
                   program->let_go ? program->max_force_n : std::numeric_limits<double>::infinity(), what,
                   zeroed_n_);
  double states_seen_s = -1;  // controller time
  const auto look_for_hang = [&](double now_s) {
    if (now_s - looked_s > kHungS) program->hung_s = now_s - looked_s, program->hung_at_s = now_s;
    looked_s = now_s;
  };
  const auto give_up = [&](const absl::Status& why) {
    look_for_hang(NowS());
    return GiveUp(program, what, why);
  };
  // Of every state since the last look: none in between may be missed.
  const auto look_back = [&](const arm::ArmState& newest) -> absl::Status {
    for (const arm::ArmState& state : parts_.arm->History(
             states_seen_s < 0 ? newest.controller_time_s : states_seen_s, newest.controller_time_s)) {
      states_seen_s = state.controller_time_s;
      if (const absl::Status safety = arm::SafetyPermitsMotion(state.safety_mode); !safety.ok()) {
        LookAtSafety();
        return safety;
      }
      if (!seen || !IsPaused(state.runtime_state)) continue;
      const std::string paused =
          absl::StrCat("the arm's program ", program->id, " was paused during ", what, " at phase '",
                       arm::PhaseName(state.phase), "', at the teach pendant or by a safety function");
      Latch(absl::StrCat("by the arm's controller (", paused, ")"));
      return absl::FailedPreconditionError(paused);
    }
    return absl::OkStatus();
  };
  for (;;) {
    const uint64_t changes = parts_.changes->count();
    const double now_s = NowS();
    look_for_hang(now_s);
    if (const absl::Status may = MayGoOn(program->guard); !may.ok()) return give_up(may);
    const absl::StatusOr<arm::ArmState> state = parts_.arm->State();
    if (!state.ok()) return give_up(state.status());
    if (const absl::Status light = force.Check(*state); !light.ok()) return give_up(light);
    if (const absl::Status normal = look_back(*state); !normal.ok()) return give_up(normal);
    if (seen && state->program_id != program->id) {
      const std::string taken = absl::StrCat("program ", program->id, " was replaced by program ",
                                             state->program_id, " during ", what);
      Latch(absl::StrCat("by the arm's controller (", taken, ")"));
      return give_up(absl::UnavailableError(taken));
    }
    seen = seen || state->program_id == program->id;
    if (seen) {
      const absl::StatusOr<bool> over = done(*state);
      if (!over.ok()) return give_up(over.status());
      if (*over) {
        left_pressed_ = false;
        return absl::OkStatus();
      }
    }

    // A program that ended by itself, or never began.
    const bool rests = state->runtime_state == arm::RuntimeState::kStopped && now_s - began_s > kEndedS;
    at_rest_since_s = !rests ? 0 : at_rest_since_s == 0 ? now_s : at_rest_since_s;
    if (seen && rests && now_s - at_rest_since_s > kEndedS) {
      const std::string ended = absl::StrCat("the arm's program ", program->id, " ended during ", what,
                                             " at phase '", arm::PhaseName(state->phase), "'");
      Latch(absl::StrCat("by the arm's controller (", ended,
                         ": its watchdog, the teach pendant or another program ended it)"));
      return give_up(absl::UnavailableError(ended));
    }
    if (!seen && now_s - began_s > kProgramStartsS + 1)
      return give_up(
          absl::UnavailableError(absl::StrCat("the arm never began program ", program->id, " (", what,
                                              "): is it in remote control, and no pop-up open?")));
    if (now_s - began_s > limit_s)
      return give_up(absl::UnavailableError(absl::StrCat(
          what, " took longer than ", ShortestNumber(std::round(limit_s)), " s and was stopped")));
    parts_.changes->WaitForChange(changes, kLookPeriodS);
  }
}

absl::Status Rig::GiveUp(Program* program, const char* what, const absl::Status& why) {
  const absl::Status reachable = parts_.arm->State().status();
  const double stopped_s = ControllerNowS();
  const absl::Status stop = parts_.arm->Stop();
  given_up_ = program->id;
  // What was not told to move waited at rest: nothing was interrupted.
  if (program->let_go) {
    left_pressed_ = true;
    const std::string during = absl::StrCat(" during ", what, ", program ", program->id);
    // Whether the watchdog had ended the program before cannot be told any more.
    if (program->hung_s > 0 && NowS() - program->hung_at_s < kAfterHangS)
      Latch(absl::StrCat("by the gateway (it hung for ",
                         ShortestNumber(std::round(10 * program->hung_s) / 10), " s", during, ")"));
    if (!reachable.ok()) LatchLoss(absl::StrCat(reachable.message(), during));
    if (closing_ && !stopped_)
      Latch(absl::StrCat("by the end of the gateway (it was told to end", during, ")"));
  }
  std::string also;
  if (!stop.ok()) absl::StrAppend(&also, " (and: ", stop.message(), ")");
  if (const absl::Status still = program->let_go ? ConfirmStandstill(stopped_s) : absl::OkStatus();
      !still.ok()) {
    absl::StrAppend(&also, " (and: ", still.message(), ")");
    Latch(absl::StrCat("by the gateway (after program ", program->id, ": ", still.message(), ")"));
  }
  return also.empty() ? why : absl::Status(why.code(), absl::StrCat(why.message(), also));
}

double Rig::ControllerNowS() const {
  const absl::StatusOr<arm::ArmState> now = parts_.arm->State();
  return now.ok() ? now->controller_time_s : 0;
}

namespace {

// Whether no program runs and no joint has moved for kStillS. `states`: since the stop, oldest first. A controller that
// skips states leaves a gap, over which one state alone shows nothing.
bool StandsStill(const arm::ArmState& now, const std::vector<arm::ArmState>& states) {
  if (now.runtime_state != arm::RuntimeState::kStopped && now.runtime_state != arm::RuntimeState::kPaused)
    return false;
  for (auto state = states.rbegin(); state != states.rend(); ++state) {
    for (size_t i = 0; i < state->joints_rad.size(); ++i)
      if (std::abs(state->joints_rad[i] - now.joints_rad[i]) >= kStillRad) return false;
    if (now.controller_time_s - state->controller_time_s >= kStillS) return true;
  }
  return false;
}

}  // namespace

absl::Status Rig::ConfirmStandstill(double from_s) {
  const double began_s = NowS();
  double heard_s = began_s;
  bool otherwise = false;
  absl::Status second;
  for (;;) {
    const uint64_t changes = parts_.changes->count();
    const absl::StatusOr<arm::ArmState> now = parts_.arm->State();
    const double now_s = NowS();
    if (now.ok()) heard_s = now_s;
    if (now.ok() && now->controller_time_s < from_s) from_s = now->controller_time_s;  // started anew
    if (now.ok() &&
        StandsStill(*now, parts_.arm->History(std::max(from_s, now->controller_time_s - kStillGapS),
                                              now->controller_time_s)))
      return absl::OkStatus();
    if (!otherwise && now_s - began_s > kFirstWayS) {
      otherwise = true;
      second = parts_.arm->StopOtherwise();
    }
    const bool gone = now_s - heard_s > kGoneS;
    if (gone || now_s - began_s > kStandstillS)
      return absl::UnavailableError(absl::StrCat(
          "the standstill is NOT CONFIRMED: ",
          gone ? absl::StrCat("the arm cannot be asked (", now.status().message(), ")")
          : now.ok() && now->runtime_state != arm::RuntimeState::kStopped
              ? "a program runs on although it was told to stop"
              : "the arm still moves",
          second.ok() ? "" : absl::StrCat("; the second way to stop it failed too (", second.message(), ")"),
          ": press the emergency stop if anything moves"));
    parts_.changes->WaitForChange(changes, kLookPeriodS);
  }
}

}  // namespace touchstone::gateway
