#include "server/gateway/rig/touch_result.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/text.h"
#include "server/geometry/pose.h"

namespace touchstone {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// A straight line through (time, distance), by least squares.
struct Line {
  double time_s = 0, distance_m = 0, speed_m_s = 0;
  int points = 0;
};

Line FitLine(const std::vector<std::pair<double, double>>& points) {
  Line line;
  line.points = static_cast<int>(points.size());
  for (const auto& [t, d] : points) line.time_s += t / points.size(), line.distance_m += d / points.size();
  double tt = 0, td = 0;
  for (const auto& [t, d] : points) {
    tt += (t - line.time_s) * (t - line.time_s);
    td += (t - line.time_s) * (d - line.distance_m);
  }
  line.speed_m_s = tt > 0 ? td / tt : 0;
  return line;
}

std::array<double, 6> NoPose() {
  std::array<double, 6> none;
  none.fill(kNaN);
  return none;
}

}  // namespace

std::optional<Eigen::Isometry3d> PoseAt(const std::vector<ArmState>& states, double controller_s,
                                        double max_gap_s) {
  const auto after =
      std::lower_bound(states.begin(), states.end(), controller_s,
                       [](const ArmState& state, double time_s) { return state.controller_time_s < time_s; });
  if (after == states.begin() || after == states.end()) return std::nullopt;
  const ArmState& a = *(after - 1);
  const ArmState& b = *after;
  const double gap_s = b.controller_time_s - a.controller_time_s;
  if (!(gap_s > 0) || gap_s > max_gap_s) return std::nullopt;
  const double share = (controller_s - a.controller_time_s) / gap_s;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::Quaterniond(a.base_from_tip.rotation())
                      .slerp(share, Eigen::Quaterniond(b.base_from_tip.rotation()))
                      .toRotationMatrix();
  pose.translation() = (1 - share) * a.base_from_tip.translation() + share * b.base_from_tip.translation();
  return pose;
}

absl::StatusOr<JournalResult> ResultOf(const TouchRecording& record) {
  const ArmTouch& motion = record.motion;
  const Eigen::Vector3d start = motion.transit.back().translation();
  const Eigen::Vector3d way = motion.end.translation() - start;
  const Eigen::Vector3d approach = way.normalized();

  // The states of the approach, and those of them that move at full speed.
  std::vector<const ArmState*> states;
  for (const ArmState& state : record.states)
    if (state.program_id == motion.program_id && state.phase == MotionPhase::kApproach)
      states.push_back(&state);
  std::vector<std::pair<double, double>> full_speed;
  double min_scaling = 1;
  const double origin_s = states.empty() ? 0 : states.front()->controller_time_s;
  const double ramp_m = motion.speed_m_s * motion.speed_m_s / (2 * record.acceleration_m_s2);
  for (const ArmState* state : states) {
    min_scaling = std::min(min_scaling, state->speed_scaling);
    const double distance_m = approach.dot(state->base_from_tip.translation() - start);
    const double speed_m_s = approach.dot(state->tip_velocity_m_s);
    if (distance_m > 2 * ramp_m && std::abs(speed_m_s - motion.speed_m_s) < 0.1 * motion.speed_m_s)
      full_speed.emplace_back(state->controller_time_s - origin_s, distance_m);
  }
  if (min_scaling < 0.995)
    return absl::FailedPreconditionError(absl::StrCat(
        "the controller scaled the speed to ", ShortestNumber(std::round(1000 * min_scaling) / 10),
        " % during the approach, so its contact times cannot be compared with others: set the speed "
        "slider to 100 % and touch again"));

  // When the approach began: from the line of constant speed and the ramp before it; else when its phase
  // was first reported.
  const Line line = FitLine(full_speed);
  JournalResult result;
  double began_controller_s = origin_s;
  if (line.points > 0) {
    // Few states, as on an accelerated clock, do not determine the speed: then it is the commanded one.
    const bool measured = line.points >= 3 && line.speed_m_s > 0;
    if (measured) result.speed_m_s = line.speed_m_s;
    began_controller_s = origin_s + line.time_s -
                         line.distance_m / (measured ? line.speed_m_s : motion.speed_m_s) -
                         motion.speed_m_s / (2 * record.acceleration_m_s2);
  }

  const bool placed = !states.empty() && record.controller_clock.valid && record.effector_clock.valid;
  const double device_rate = record.effector_clock.valid ? record.effector_clock.rate : record.time_scale;
  double first_s = std::numeric_limits<double>::infinity(), last_s = -first_s;
  for (const auto& ticks : record.contacts.contact_ticks)
    if (ticks.has_value()) {
      first_s = std::min(first_s, static_cast<double>(*ticks) / record.tick_hz);
      last_s = std::max(last_s, static_cast<double>(*ticks) / record.tick_hz);
    }
  // Device seconds at which the approach began; without a record of the arm, the first contact stands for it.
  const double began_device_s =
      placed ? record.effector_clock.RemoteOf(record.controller_clock.HostOf(began_controller_s)) : first_s;
  for (const auto& ticks : record.contacts.contact_ticks) {
    JournalFinger finger;
    finger.contact_time_s = kNaN;
    finger.base_from_tip = NoPose();
    if (ticks.has_value()) {
      const double device_s = static_cast<double>(*ticks) / record.tick_hz;
      finger.ticks = *ticks;
      finger.contact_time_s = (device_s - began_device_s) / device_rate * record.time_scale;
      if (placed) {
        const double controller_s = record.controller_clock.RemoteOf(record.effector_clock.HostOf(device_s));
        if (const auto pose = PoseAt(record.states, controller_s, 0.1 * std::max(1.0, record.time_scale)))
          finger.base_from_tip = PoseVectorOf(*pose);
      }
    }
    result.fingers.push_back(finger);
  }
  // No contact comes before its approach. Where it seems so, the two clocks were apart by more than the way
  // took (on a clock that is accelerated, when the host is busy): the fingers share that error, so it goes,
  // and their differences stay.
  double early_s = 0;
  for (const JournalFinger& finger : result.fingers)
    if (finger.contact_time_s < early_s) early_s = finger.contact_time_s;
  for (JournalFinger& finger : result.fingers) finger.contact_time_s -= early_s;

  const double scale = record.time_scale;
  const double span_s = last_s > first_s ? (last_s - first_s) / device_rate * scale : 0;
  // No damage to the line or the device's counter may pass for a contact.
  if (motion.duration_s > 0 && span_s > 2 * motion.duration_s + 10)
    return absl::DataLossError(
        absl::StrCat("the end effector reports contacts ", ShortestNumber(std::round(span_s)),
                     " s apart in a touch of about ", ShortestNumber(std::round(motion.duration_s)),
                     " s: its counter must be wrong"));
  const double tick_s = 1.0 / record.tick_hz / device_rate * scale;
  const double rate_share =
      record.effector_clock.valid ? record.effector_clock.rate_uncertainty / device_rate : 2e-4;
  result.time_uncertainty_s = std::hypot(tick_s / std::sqrt(12.0), rate_share * span_s);
  result.synchronisation_uncertainty_s =
      placed ? std::hypot(record.effector_clock.offset_uncertainty_s / device_rate,
                          record.controller_clock.offset_uncertainty_s / record.controller_clock.rate) *
                   scale
             : kNaN;
  result.effector_drift = device_rate / scale - 1;
  return result;
}

}  // namespace touchstone
