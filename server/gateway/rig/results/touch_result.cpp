#include "server/gateway/rig/results/touch_result.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/numbers/nan.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/gateway/rig/results/approach_fit.h"
#include "server/gateway/rig/results/touch_series.h"
#include "server/geometry/pose.h"

namespace touchstone::gateway {
namespace {

constexpr char kMaybeNoContact[] =
    "what was reported may be no contact, and the touch is refused; see that the finger moves freely, or "
    "whether a wire is broken, and touch again";

std::array<double, 6> NoPose() {
  std::array<double, 6> none;
  none.fill(kNaN);
  return none;
}

}  // namespace

absl::Status CheckReleased(const effector::EffectorTouch& contacts) {
  if (contacts.pressed_mask == 0) return absl::OkStatus();
  const bool one = (contacts.pressed_mask & (contacts.pressed_mask - 1)) == 0;
  return absl::FailedPreconditionError(absl::StrCat(
      effector::FingersText(contacts.pressed_mask), one ? " is" : " are",
      " still pressed although the tool is back at its start: ", one ? "it sticks" : "they stick",
      ", so that ", kMaybeNoContact));
}

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

// States before the first contact alone, if there are so many: from then on the object holds against the arm.
constexpr int kEnoughFreeStates = 400;
constexpr double kFullSpeed = 0.995;  // share
// What is certain: so many standard uncertainties of the clocks, and what a busy host adds to them.
constexpr double kSigmas = 4, kBusyHostS = 0.005;

// The approach, as the controller's states show it.
struct Approach {
  bool seen = false;                          // any state of it was recorded
  double began_controller_s = 0;              // controller time
  double began_controller_uncertainty_s = 0;  // standard
  double speed_m_s = 0;                       // measured
};

// The controller's limiter and the pendant's slider act together: the arm's speed is their product.
absl::Status CheckSpeedScaling(const std::vector<arm::ArmState>& states) {
  const arm::ArmState* slowest = nullptr;
  for (const arm::ArmState& state : states)
    if (slowest == nullptr || state.speed_scaling * state.target_speed_fraction <
                                  slowest->speed_scaling * slowest->target_speed_fraction)
      slowest = &state;
  if (slowest == nullptr || slowest->speed_scaling * slowest->target_speed_fraction >= kFullSpeed)
    return absl::OkStatus();
  const auto percent = [](double share) { return ShortestNumber(std::round(1000 * share) / 10); };
  return absl::FailedPreconditionError(
      absl::StrCat("the arm did not go at the commanded speed during the approach, so its contact times "
                   "cannot be compared with "
                   "others: the speed slider stood at ",
                   percent(slowest->target_speed_fraction), " % and the controller's limiter left ",
                   percent(slowest->speed_scaling),
                   " %; set the slider at the teach pendant to 100 %, see whether a safety limit (reduced "
                   "mode, a plane) slows the "
                   "arm, and touch again"));
}

// Controller time of a tick of the device, where both clocks are known.
double ControllerTimeS(const TouchRecording& record, uint64_t ticks) {
  const double device_s = static_cast<double>(ticks) / record.tick_hz;
  return record.controller_clock.RemoteOf(record.effector_clock.HostOf(device_s));
}

// Controller times of the first and the last contact; none if there is no contact or no common time.
std::optional<std::pair<double, double>> ContactSpan(const TouchRecording& record) {
  if (!record.controller_clock.valid || !record.effector_clock.valid) return std::nullopt;
  std::optional<std::pair<double, double>> span;
  for (const auto& ticks : record.contacts.contact_ticks) {
    if (!ticks.has_value()) continue;
    const double controller_s = ControllerTimeS(record, *ticks);
    if (!span.has_value()) span = {controller_s, controller_s};
    span->first = std::min(span->first, controller_s);
    span->second = std::max(span->second, controller_s);
  }
  return span;
}

// How far the tip had come in every state.
std::vector<ApproachState> DistancesOf(const TouchRecording& record,
                                       const std::vector<arm::ArmState>& states) {
  const Eigen::Vector3d start = record.motion.transit.back().translation(),
                        way = record.motion.end.translation() - start;
  std::vector<ApproachState> distances;
  for (const arm::ArmState& state : states) {
    if (!distances.empty() && state.controller_time_s <= distances.back().time_s) continue;  // sent twice
    distances.push_back(
        {state.controller_time_s, way.normalized().dot(state.base_from_tip.translation() - start)});
  }
  return distances;
}

// The states of the approach at its commanded course: until it brakes, whether at the last contact or at the end of
// the stroke.
std::vector<ApproachState> CourseOf(const TouchRecording& record,
                                    const std::vector<ApproachState>& distances) {
  const arm::ArmTouch& motion = record.motion;
  const Eigen::Vector3d way = motion.end.translation() - motion.transit.back().translation();
  const ApproachProfile profile{motion.speed_m_s, record.acceleration_m_s2};
  const double brakes_m = way.norm() - profile.RampM();
  const std::optional<std::pair<double, double>> contacts = ContactSpan(record);
  std::vector<ApproachState> course, all;
  int free_states = 0;
  for (const ApproachState& each : distances) {
    if (each.distance_m > brakes_m) break;
    all.push_back(each);
    if (!contacts.has_value() || each.time_s > contacts->second) continue;
    course.push_back(each);
    if (each.time_s < contacts->first) free_states = static_cast<int>(course.size());
  }
  // Without a common time, or one that is wrong by more than the approach took, the short braking is an outlier.
  if (static_cast<int>(course.size()) < kMinApproachStates) return all;
  if (free_states >= kEnoughFreeStates) course.resize(free_states);
  return course;
}

std::vector<arm::ArmState> ApproachStates(const TouchRecording& record) {
  std::vector<arm::ArmState> states;
  for (const arm::ArmState& state : record.states)
    if (state.program_id == record.motion.program_id && state.phase == arm::MotionPhase::kApproach)
      states.push_back(state);
  return states;
}

absl::StatusOr<Approach> ApproachOf(const TouchRecording& record) {
  Approach approach;
  const std::vector<arm::ArmState> states = ApproachStates(record);
  // Recovered after an interruption: nobody recorded the arm.
  if (states.empty() && record.recovered) return approach;
  TOUCHSTONE_RETURN_IF_ERROR(CheckSpeedScaling(states));
  const std::vector<ApproachState> distances = DistancesOf(record, states);
  const ApproachProfile profile{record.motion.speed_m_s, record.acceleration_m_s2};
  TOUCHSTONE_ASSIGN_OR_RETURN(const ApproachFit fit, FitApproach(CourseOf(record, distances), profile,
                                                                 NoStateIsMissing(distances, profile)));
  approach.seen = true;
  approach.began_controller_s = fit.began_s;
  approach.began_controller_uncertainty_s = fit.began_uncertainty_s;
  approach.speed_m_s = fit.speed_m_s;
  return approach;
}

// Standard uncertainty of a clock's reading at a remote time, in host seconds.
double HostUncertaintyS(const timing::ClockEstimate& clock, double remote_s) {
  const double age_s = std::abs(clock.HostOf(remote_s) - clock.host_at_s);
  return std::hypot(clock.offset_uncertainty_s, clock.rate_uncertainty * age_s) / clock.rate;
}

// Whether the tool certainly still approached then, as far as both clocks and the arm's states tell.
bool IsBeforeTheTurn(const TouchRecording& record, uint64_t ticks) {
  const std::vector<arm::ArmState> states = ApproachStates(record);
  if (states.empty() || !record.controller_clock.valid || !record.effector_clock.valid) return false;
  const double controller_s = ControllerTimeS(record, ticks);
  const double host_s = kSigmas * std::hypot(HostUncertaintyS(record.effector_clock,
                                                              static_cast<double>(ticks) / record.tick_hz),
                                             HostUncertaintyS(record.controller_clock, controller_s)) +
                        kBusyHostS;
  return controller_s < states.back().controller_time_s - host_s * record.controller_clock.rate;
}

// Contact times since the device's `began_device_s`, and poses at contact where `synchronised`. *moved_s: by how much
// all of them were moved, since no contact comes before its approach.
std::vector<session::JournalFinger> FingersOf(const TouchRecording& record, double began_device_s,
                                              double device_rate, bool synchronised, double* moved_s) {
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
        if (const auto pose = PoseAt(record.states, ControllerTimeS(record, *ticks),
                                     0.1 * std::max(1.0, record.time_scale)))
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
  *moved_s = -early_s;
  return fingers;
}

}  // namespace

absl::Status CheckHeld(const TouchRecording& record) {
  const effector::EffectorTouch& contacts = record.contacts;
  uint64_t last_contact = 0;
  for (const auto& ticks : contacts.contact_ticks) last_contact = std::max(last_contact, ticks.value_or(0));
  for (size_t i = 0; i < contacts.release_ticks.size(); ++i) {
    const std::optional<uint64_t>&contact = contacts.contact_ticks[i], &release = contacts.release_ticks[i];
    if (!contact.has_value() || !release.has_value()) continue;
    // The tool goes on until the last contact: that is certain by the device's clock alone.
    if (*release >= last_contact && !IsBeforeTheTurn(record, *release)) continue;
    const double held_s = static_cast<double>(*release - std::min(*contact, *release)) / record.tick_hz;
    return absl::FailedPreconditionError(absl::StrCat(
        effector::FingersText(1u << i), " let go ", ShortestNumber(std::round(1e4 * held_s) / 10),
        " ms after it had reported a contact, while the tool still approached: it stuck before and freed "
        "itself, or slid off an edge, so that ",
        kMaybeNoContact));
  }
  return absl::OkStatus();
}

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
  double moved_s = 0;
  result.fingers = FingersOf(record, began_device_s, device_rate, synchronised, &moved_s);
  const double tick_s = 1.0 / record.tick_hz / device_rate * scale;
  const double rate_share =
      record.effector_clock.valid ? record.effector_clock.rate_uncertainty / device_rate : 2e-4;
  result.time_uncertainty_s = std::hypot(tick_s / std::sqrt(12.0), rate_share * span_s);
  // Of the approach's start on the device's clock: how well the states show it, and both clocks then.
  result.synchronisation_uncertainty_s = kNaN;
  if (synchronised) {
    result.start_unix_s =
        record.controller_clock.HostOf(approach.began_controller_s) + record.unix_minus_host_s;
    const double host_s = std::hypot(HostUncertaintyS(record.effector_clock, began_device_s),
                                     HostUncertaintyS(record.controller_clock, approach.began_controller_s),
                                     approach.began_controller_uncertainty_s / record.controller_clock.rate);
    result.synchronisation_uncertainty_s = std::hypot(host_s * scale, moved_s);
  }
  result.effector_drift = device_rate / scale - 1;
  return result;
}

absl::StatusOr<v1::TouchSeries> SeriesOf(const TouchRecording& record) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const Approach approach, ApproachOf(record));
  const double controller_rate =
      record.controller_clock.valid ? record.controller_clock.rate : record.time_scale;
  v1::TouchSeries series;
  for (const arm::ArmState& state : ApproachStates(record)) {
    series.add_time_s((state.controller_time_s - approach.began_controller_s) / controller_rate *
                      record.time_scale);
    for (const double q : state.joints_rad) series.add_joints_rad(q);
    for (const double part : geometry::PoseVectorOf(state.base_from_tip)) series.add_base_from_tip(part);
    for (int axis = 0; axis < 3; ++axis) series.add_tip_force_n(state.tip_force_n[axis]);
  }
  return series;
}

}  // namespace touchstone::gateway
