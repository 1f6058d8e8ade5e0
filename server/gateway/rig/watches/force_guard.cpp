#include "server/gateway/rig/watches/force_guard.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <utility>
#include <vector>

namespace touchstone::gateway {
namespace {

constexpr double kRestMS = 2e-3;                // slower than any motion but the slowest approaches
constexpr double kRestS = 0.2, kLongRestS = 2;  // rig time that states at rest are looked for in
constexpr double kMaxRestShare = 0.5;           // of the limit
constexpr double kNoticedShare = 0.45;          // of the limit, at rest, beyond which no motion begins
constexpr double kReleaseShare = 0.25;          // of the limit, by which the force may grow while it lets go

}  // namespace

Eigen::Vector3d ForceOf(const arm::ArmState& state, const Eigen::Vector3d& zeroed_n) {
  return state.tip_force_n + state.base_from_tip.linear() * zeroed_n;
}

Eigen::Vector3d ForceAtRest(const arm::Arm& arm, const Eigen::Vector3d& zeroed_n) {
  const absl::StatusOr<arm::ArmState> now = arm.State();
  if (!now.ok()) return Eigen::Vector3d::Zero();  // whoever watches the motion finds that too
  for (const double span_s : {kRestS, kLongRestS}) {
    Eigen::Vector3d sum_n = Eigen::Vector3d::Zero();
    int count = 0;
    for (const arm::ArmState& state : arm.History(now->controller_time_s - span_s, now->controller_time_s)) {
      if (state.tip_velocity_m_s.norm() > kRestMS) continue;
      sum_n += ForceOf(state, zeroed_n);
      ++count;
    }
    if (count > 0) return sum_n / count;
  }
  return Eigen::Vector3d::Zero();
}

absl::Status CheckForceAtRest(const Eigen::Vector3d& at_rest_n, double max_force_n) {
  if (at_rest_n.norm() <= kNoticedShare * max_force_n) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrFormat("the arm feels %.1f N on the tip at rest, before it moves; at most %.1f N (%.0f %% of "
                      "limits.max_force_n): "
                      "take away what presses against the tool, or set the payload right, in the "
                      "controller's installation and in "
                      "limits.payload_kg and limits.payload_cog_mm; a sensor that was zeroed while something "
                      "pressed forgets it with the "
                      "next power-up",
                      at_rest_n.norm(), kNoticedShare * max_force_n, 100 * kNoticedShare));
}

ForceGuard::ForceGuard(const arm::Arm& arm, double max_force_n, std::string what,
                       const Eigen::Vector3d& zeroed_n)
    : arm_(arm),
      max_force_n_(max_force_n),
      allowed_n_(max_force_n),
      what_(std::move(what)),
      zeroed_n_(zeroed_n) {
  const absl::StatusOr<arm::ArmState> now = arm.State();
  if (!now.ok()) return;  // whoever watches the motion finds that too
  seen_s_ = now->controller_time_s;
  const Eigen::Vector3d felt_n = ForceAtRest(arm, zeroed_n_);
  at_rest_n_ = felt_n;
  const double limit_n = kMaxRestShare * max_force_n_;
  if (at_rest_n_.norm() > limit_n) at_rest_n_ *= limit_n / at_rest_n_.norm();
  allowed_n_ = std::max(max_force_n_, (felt_n - at_rest_n_).norm() + kReleaseShare * max_force_n_);
}

absl::Status ForceGuard::Check(const arm::ArmState& newest) {
  for (const arm::ArmState& state : arm_.History(seen_s_, newest.controller_time_s))
    if (absl::Status light = CheckState(state); !light.ok()) return light;
  seen_s_ = std::max(seen_s_, newest.controller_time_s);
  return CheckState(newest);
}

absl::Status ForceGuard::CheckState(const arm::ArmState& state) {
  const double force_n = (ForceOf(state, zeroed_n_) - at_rest_n_).norm();
  if (force_n <= allowed_n_) {
    allowed_n_ = std::max(max_force_n_, std::min(allowed_n_, force_n + kReleaseShare * max_force_n_));
    return absl::OkStatus();
  }
  return absl::FailedPreconditionError(absl::StrFormat(
      "%s pressed with %.1f N on the tip, beyond the %.1f N that were felt at rest before it; at most %.1f N "
      "(limits.max_force_n): it was stopped. Find out what it ran into; with nothing there, set "
      "limits.payload_kg and "
      "its centre of gravity right",
      what_, force_n, at_rest_n_.norm(), max_force_n_));
}

}  // namespace touchstone::gateway
