#include "server/gateway/rig/touch_result.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/nan.h"
#include "server/base/status.h"
#include "server/base/text.h"
#include "server/geometry/pose.h"

namespace touchstone::gateway {
namespace {

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

std::optional<Eigen::Isometry3d> PoseAt(const std::vector<arm::ArmState>& states, double controller_s,
                                        double max_gap_s) {
  const auto after = std::lower_bound(
      states.begin(), states.end(), controller_s,
      [](const arm::ArmState& state, double time_s) { return state.controller_time_s < time_s; });
  if (after == states.begin() || after == states.end()) return std::nullopt;
  const arm::ArmState& a = *(after - 1);
  const arm::ArmState& b = *after;
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

namespace {

// The straight part of an approach, as the controller's states show it.
struct Approach {
  bool seen = false;              // any state of it was recorded
  double began_controller_s = 0;  // controller time
  double speed_m_s = 0;           // measured; 0: too few states
};

absl::StatusOr<Approach> ApproachOf(const TouchRecording& record) {
  const arm::ArmTouch& motion = record.motion;
  const Eigen::Vector3d start = motion.transit.back().translation();
  const Eigen::Vector3d direction = (motion.end.translation() - start).normalized();
  const double ramp_m = motion.speed_m_s * motion.speed_m_s / (2 * record.acceleration_m_s2);

  Approach approach;
  std::vector<std::pair<double, double>> full_speed;  // time since the first state, distance from the start
  double min_scaling = 1, origin_s = 0;
  for (const arm::ArmState& state : record.states) {
    if (state.program_id != motion.program_id || state.phase != arm::MotionPhase::kApproach) continue;
    if (!approach.seen) origin_s = state.controller_time_s;
    approach.seen = true;
    min_scaling = std::min(min_scaling, state.speed_scaling);
    const double distance_m = direction.dot(state.base_from_tip.translation() - start);
    const double speed_m_s = direction.dot(state.tip_velocity_m_s);
    if (distance_m > 2 * ramp_m && std::abs(speed_m_s - motion.speed_m_s) < 0.1 * motion.speed_m_s)
      full_speed.emplace_back(state.controller_time_s - origin_s, distance_m);
  }
  if (min_scaling < 0.995)
    return absl::FailedPreconditionError(absl::StrCat(
        "the controller scaled the speed to ", ShortestNumber(std::round(1000 * min_scaling) / 10),
        " % during the approach, so its contact times cannot be compared with others: set the speed "
        "slider to 100 % and touch again"));

  // When it began: from the line of constant speed and the ramp before it; else when its phase was first
  // reported.
  approach.began_controller_s = origin_s;
  const Line line = FitLine(full_speed);
  if (line.points == 0) return approach;
  // Few states, as on an accelerated clock, do not determine the speed: then it is the commanded one.
  const bool measured = line.points >= 3 && line.speed_m_s > 0;
  if (measured) approach.speed_m_s = line.speed_m_s;
  approach.began_controller_s = origin_s + line.time_s -
                                line.distance_m / (measured ? line.speed_m_s : motion.speed_m_s) -
                                motion.speed_m_s / (2 * record.acceleration_m_s2);
  return approach;
}

// Contact times since the device's `began_device_s`, and poses at contact where `synchronised`.
std::vector<session::JournalFinger> FingersOf(const TouchRecording& record, double began_device_s,
                                              double device_rate, bool synchronised) {
  std::vector<session::JournalFinger> fingers;
  for (const auto& ticks : record.contacts.contact_ticks) {
    session::JournalFinger finger;
    finger.contact_time_s = kNaN;
    finger.base_from_tip = NoPose();
    if (ticks.has_value()) {
      const double device_s = static_cast<double>(*ticks) / record.tick_hz;
      finger.ticks = *ticks;
      finger.contact_time_s = (device_s - began_device_s) / device_rate * record.time_scale;
      if (synchronised) {
        const double controller_s = record.controller_clock.RemoteOf(record.effector_clock.HostOf(device_s));
        if (const auto pose = PoseAt(record.states, controller_s, 0.1 * std::max(1.0, record.time_scale)))
          finger.base_from_tip = geometry::PoseVectorOf(*pose);
      }
    }
    fingers.push_back(finger);
  }
  // No contact comes before its approach. Where it seems so, the two clocks were apart by more than the approach
  // took (on a clock that is accelerated, when the host is busy): the fingers share that error, so it is removed,
  // and their differences stay.
  double early_s = 0;
  for (const session::JournalFinger& finger : fingers)
    if (finger.contact_time_s < early_s) early_s = finger.contact_time_s;
  for (session::JournalFinger& finger : fingers) finger.contact_time_s -= early_s;
  return fingers;
}

}  // namespace

absl::StatusOr<session::JournalResult> ResultOf(const TouchRecording& record) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const Approach approach, ApproachOf(record));
  const bool synchronised = approach.seen && record.controller_clock.valid && record.effector_clock.valid;
  const double scale = record.time_scale;
  const double device_rate = record.effector_clock.valid ? record.effector_clock.rate : scale;
  double first_s = std::numeric_limits<double>::infinity(), last_s = -first_s;
  for (const auto& ticks : record.contacts.contact_ticks)
    if (ticks.has_value()) {
      first_s = std::min(first_s, static_cast<double>(*ticks) / record.tick_hz);
      last_s = std::max(last_s, static_cast<double>(*ticks) / record.tick_hz);
    }
  const double span_s = last_s > first_s ? (last_s - first_s) / device_rate * scale : 0;
  // No damage to the line or the device's counter may pass for a contact.
  if (record.motion.duration_s > 0 && span_s > 2 * record.motion.duration_s + 10)
    return absl::DataLossError(
        absl::StrCat("the end effector reports contacts ", ShortestNumber(std::round(span_s)),
                     " s apart in a touch of about ", ShortestNumber(std::round(record.motion.duration_s)),
                     " s: its counter must be wrong"));

  session::JournalResult result;
  result.speed_m_s = approach.speed_m_s;
  // Device seconds at which the approach began; without a record of the arm, the first contact stands for it.
  const double began_device_s =
      synchronised
          ? record.effector_clock.RemoteOf(record.controller_clock.HostOf(approach.began_controller_s))
          : first_s;
  result.fingers = FingersOf(record, began_device_s, device_rate, synchronised);
  const double tick_s = 1.0 / record.tick_hz / device_rate * scale;
  const double rate_share =
      record.effector_clock.valid ? record.effector_clock.rate_uncertainty / device_rate : 2e-4;
  result.time_uncertainty_s = std::hypot(tick_s / std::sqrt(12.0), rate_share * span_s);
  result.synchronisation_uncertainty_s =
      synchronised ? std::hypot(record.effector_clock.offset_uncertainty_s / device_rate,
                                record.controller_clock.offset_uncertainty_s / record.controller_clock.rate) *
                         scale
                   : kNaN;
  result.effector_drift = device_rate / scale - 1;
  return result;
}

}  // namespace touchstone::gateway
