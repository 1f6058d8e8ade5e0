// What the controller sends: states, messages, and whether the arm may move.
#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/gateway/arm/ur_arm_on_tcp.h"
#include "server/gateway/arm/ur_modes.h"
#include "server/geometry/pose.h"

namespace touchstone::gateway::arm {
namespace {

constexpr double kRemoteControlAnswerS = 2;  // host time

}  // namespace

void UrArmOnTcp::OnSample(const RtdeSample& sample, double host_s) {
  ArmState state;
  state.host_time_s = host_s;
  state.controller_time_s = sample.timestamp_s;
  state.joints_rad = sample.actual_q_rad;
  state.robot_mode = static_cast<RobotMode>(sample.robot_mode);
  state.safety_mode = static_cast<SafetyMode>(sample.safety_mode);
  state.runtime_state = static_cast<RuntimeState>(sample.runtime_state);
  state.robot_status_bits = sample.robot_status_bits;
  state.safety_status_bits = sample.safety_status_bits;
  state.speed_scaling = sample.speed_scaling;
  state.target_speed_fraction = sample.target_speed_fraction;
  state.tip_force_n << sample.actual_tcp_force[0], sample.actual_tcp_force[1], sample.actual_tcp_force[2];
  state.program_id = static_cast<uint32_t>(sample.program_register);
  state.phase = static_cast<MotionPhase>(sample.phase_register);

  // The controller sends the pose of whatever tool was set last; ours may not have been set yet.
  const Eigen::Isometry3d base_from_tcp = geometry::PoseFromVector(sample.actual_tcp_pose);
  const Eigen::Vector3d turning(sample.actual_tcp_speed[3], sample.actual_tcp_speed[4],
                                sample.actual_tcp_speed[5]);
  state.tip_velocity_m_s << sample.actual_tcp_speed[0], sample.actual_tcp_speed[1],
      sample.actual_tcp_speed[2];
  state.base_from_tip = base_from_tcp;
  if (sample.has_tcp_offset) {
    state.base_from_tip = base_from_tcp * geometry::PoseFromVector(sample.tcp_offset).inverse() *
                          options_.script.flange_from_tip;
    state.tip_velocity_m_s += turning.cross(state.base_from_tip.translation() - base_from_tcp.translation());
  }
  {
    std::lock_guard<std::mutex> lock(mutex_);
    history_.Add(state);
    // A state that echoes a new heartbeat was made between the heartbeat's sending and its own arrival; without an
    // echo only the later of the two is known.
    const double sent_s = sample.has_tcp_offset ? sent_heartbeats_.TakeSendingOf(sample.heartbeat_echo) : 0;
    if (sent_s > 0)
      clock_.AddRoundTrip(sent_s, state.controller_time_s, state.controller_time_s, host_s);
    else
      clock_.AddOneWay(state.controller_time_s, host_s, options_.assumed_delay_s);
    if (start_.program_id == state.program_id) start_ = Start();
  }
  changes_->Notify();
}

void UrArmOnTcp::OnPrimary(const PrimaryUpdate& update) {
  std::lock_guard<std::mutex> lock(mutex_);
  if (update.kinematics.has_value()) kinematics_ = update.kinematics;
  if (!update.started.empty() && update.started != kStopProgramName &&
      std::find(sent_programs_.begin(), sent_programs_.end(), update.started) == sent_programs_.end()) {
    ++foreign_.count;
    foreign_.newest = update.started;
    changes_->Notify();
  }
  if (start_.program_id == 0 || !update.is_error) return;
  start_.complaint = update.message;
  start_.refused = start_.refused || update.is_exception;
  if (start_.refused) changes_->Notify();
}

absl::Status UrArmOnTcp::StartFailure() const {
  if (start_.program_id == 0) return absl::OkStatus();
  const double waited_s = timing::HostNowS() - start_.sent_host_s;
  if (!start_.refused && waited_s < options_.program_start_s) return absl::OkStatus();
  suspect_ = true;
  return absl::UnavailableError(absl::StrCat(
      "the controller at ", options_.address, " did not begin program ", start_.program_id,
      start_.refused ? "" : absl::StrFormat(" within %.1f s", waited_s),
      start_.complaint.empty() ? ": is it in remote control, and is no pop-up open at the teach pendant?"
                               : absl::StrCat("; it says: ", start_.complaint)));
}

absl::StatusOr<ArmState> UrArmOnTcp::State() const {
  TOUCHSTONE_RETURN_IF_ERROR(rtde_.Link());
  std::lock_guard<std::mutex> lock(mutex_);
  const ArmState* newest = history_.newest();
  if (newest == nullptr)
    return absl::UnavailableError(
        absl::StrCat("the controller at ", options_.address, " has sent no state yet"));
  const double age_s = timing::HostNowS() - newest->host_time_s;
  if (age_s > options_.frozen_after_s)
    return absl::UnavailableError(
        absl::StrFormat("the controller at %s has been silent for %.1f s", options_.address, age_s));
  TOUCHSTONE_RETURN_IF_ERROR(StartFailure());
  return *newest;
}

absl::Status UrArmOnTcp::Ready() const {
  TOUCHSTONE_ASSIGN_OR_RETURN(const ArmState state, State());
  TOUCHSTONE_RETURN_IF_ERROR(ModesPermitMotion(state.robot_mode, state.safety_mode));
  if (!ProgramPortsConnected())
    return absl::UnavailableError(absl::StrCat("no connection to the controller's program interface at ",
                                               options_.address, ":", options_.secondary_port,
                                               "; trying again"));
  // Only e-Series controllers know local control, and only a program that did not begin makes one suspect it.
  if (suspect_ && nominal_.model().e_series) {
    const absl::StatusOr<std::string> remote = dashboard_.Ask("is in remote control", kRemoteControlAnswerS);
    if (remote.ok() && absl::AsciiStrToLower(*remote) == "false")
      return absl::FailedPreconditionError(
          "the controller is in local control and runs no programs from outside: switch it to remote control "
          "at the "
          "teach pendant");
  }
  return absl::OkStatus();
}

}  // namespace touchstone::gateway::arm
