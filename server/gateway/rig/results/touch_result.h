// What the recorded states and contacts of a touch amount to. Pure functions.
#pragma once

#include <optional>
#include <vector>

#include <absl/status/statusor.h>

#include "server/gateway/arm/arm.h"
#include "server/gateway/effector/effector.h"
#include "server/gateway/timing/clock_sync.h"
#include "server/session/journal/journal.h"

namespace touchstone::gateway {

struct TouchRecording {
  arm::ArmTouch motion;
  double acceleration_m_s2 = 0;
  double time_scale = 1;
  uint32_t tick_hz = 1;
  effector::EffectorTouch contacts;
  timing::ClockEstimate effector_clock;    // device seconds on host seconds
  timing::ClockEstimate controller_clock;  // controller seconds on host seconds
  std::vector<arm::ArmState> states;       // of the whole touch, oldest first
  double unix_minus_host_s = 0;            // wall clock less the host's time
  bool recovered = false;  // after an interruption, without states: times then count from the first contact
};

// Contact times since the approach began, poses at contact, speed, uncertainties (rig seconds), when it began (Unix
// time; 0: unknown). The session time stays 0. FAILED_PRECONDITION if the approach was not made at the commanded speed, by what the controller
// says or by its poses: times would not be comparable. UNAVAILABLE if too few states of it arrived.
absl::StatusOr<session::JournalResult> ResultOf(const TouchRecording& record);

// Whether every finger let go when the tool was back at its start. FAILED_PRECONDITION names those that did not: such a
// finger sticks, and what it reported may be no contact.
absl::Status CheckReleased(const effector::EffectorTouch& contacts);

// Whether every finger that had contact stayed pressed until the tool turned back. FAILED_PRECONDITION names one that did
// not. After the last contact that is known only with a common time and states of the approach; OK without.
absl::Status CheckHeld(const TouchRecording& record);

// base_from_tip between the two states round a controller time; nothing if they do not enclose it within
// 0.1 rig s.
std::optional<Eigen::Isometry3d> PoseAt(const std::vector<arm::ArmState>& states, double controller_s,
                                        double max_gap_s);

}  // namespace touchstone::gateway
