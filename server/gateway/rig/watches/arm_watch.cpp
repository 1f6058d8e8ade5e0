#include "server/gateway/rig/watches/arm_watch.h"

#include <absl/strings/str_cat.h>

#include <cmath>
#include <limits>

#include "server/base/text/printable.h"
#include "server/gateway/arm/ur_modes.h"

namespace touchstone::gateway {
namespace {

// How long a program may run on after this gateway's has ended or was stopped, the controller's and the host's seconds:
// its last cycles, and a stop that brakes. Programs that begin are told at once (arm::ForeignPrograms); this finds what
// ran before the controller was reached.
constexpr double kRunsOnS = 1;
constexpr size_t kMaxNameBytes = 100;

// `interrupts`: it stopped a motion, or one was refused because of it.
bool Latches(arm::SafetyMode mode, bool interrupts) {
  switch (arm::KindOf(mode)) {
    case arm::SafetyKind::kPermitsMotion:
      return false;
    case arm::SafetyKind::kSafeguard:
      return interrupts;
    default:
      return true;
  }
}

std::string When(const arm::ArmState& state, const ArmWatch::Doing& doing) {
  return doing.moving     ? absl::StrCat("during program ", state.program_id, ", phase '",
                                         arm::PhaseName(state.phase), "'")
         : doing.powering ? "while the arm was powered up"
                          : "between motions";
}

}  // namespace

std::string ArmWatch::SafetyReason(const arm::ArmState& state, const Doing& doing) {
  if (arm::SafetyPermitsMotion(state.safety_mode).ok()) {
    latched_safety_.reset();
    return "";
  }
  if (latched_safety_ == state.safety_mode || !Latches(state.safety_mode, doing.moving)) return "";
  latched_safety_ = state.safety_mode;
  return absl::StrCat(arm::SafetyModeName(state.safety_mode), " ",
                      seen_s_ < 0 ? "found when the arm was reached" : When(state, doing));
}

std::string ArmWatch::PowerReason(const arm::ArmState& state, const Doing& doing) {
  if (state.robot_mode == arm::RobotMode::kRunning) {
    ran_ = true;
    return "";
  }
  const bool ran = ran_;
  ran_ = false;
  // An emergency stop takes the power away and says more.
  if (!ran || doing.powering || !arm::SafetyPermitsMotion(state.safety_mode).ok()) return "";
  return absl::StrCat("the arm, which was running, was found in mode ", arm::RobotModeName(state.robot_mode),
                      " ", When(state, doing), ": somebody powered it off, or it lost its power");
}

std::string ArmWatch::ProgramReason(const arm::ArmState& state, const Doing& doing) {
  if (state.runtime_state != arm::RuntimeState::kPlaying || doing.moving) {
    playing_since_.reset();
    playing_latched_ = false;
    return "";
  }
  if (!playing_since_.has_value()) playing_since_ = state;
  if (playing_latched_ || state.controller_time_s - playing_since_->controller_time_s < kRunsOnS ||
      state.host_time_s - playing_since_->host_time_s < kRunsOnS)
    return "";
  playing_latched_ = true;
  return "a program that is not this gateway's runs on the controller";
}

std::vector<std::string> ArmWatch::Look(const arm::Arm& arm, const Doing& doing) {
  std::vector<std::string> reasons;
  const auto add = [&](std::string reason) {
    if (!reason.empty()) reasons.push_back(std::move(reason));
  };
  const arm::ForeignPrograms foreign = arm.Foreign();
  if (foreign.count > foreign_programs_)
    add(absl::StrCat("the program '", Printable(foreign.newest, kMaxNameBytes),
                     "', which is not this gateway's, began on the controller"));
  foreign_programs_ = foreign.count;

  const absl::StatusOr<arm::ArmState> now = arm.State();
  if (now.ok() && now->controller_time_s < seen_s_) {
    if (ran_ && !doing.powering)
      add(absl::StrCat("the controller, whose arm was running, was started anew ", When(*now, doing)));
    ran_ = false;
    seen_s_ = 0;
  }
  const double infinity = std::numeric_limits<double>::infinity();
  for (const arm::ArmState& state : arm.History(std::nextafter(seen_s_, infinity), infinity)) {
    add(SafetyReason(state, doing));
    add(PowerReason(state, doing));
    add(ProgramReason(state, doing));
    seen_s_ = state.controller_time_s;
  }
  // A safeguard that stood open unnoticed, until somebody wanted to move.
  if (doing.asked && now.ok() && latched_safety_ != now->safety_mode && Latches(now->safety_mode, true)) {
    latched_safety_ = now->safety_mode;
    add(absl::StrCat(arm::SafetyModeName(now->safety_mode), " when a motion was asked for"));
  }
  return reasons;
}

}  // namespace touchstone::gateway
