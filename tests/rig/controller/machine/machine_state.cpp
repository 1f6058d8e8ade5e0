// Where the arm is, and what it reports.
//
// The arm behind its target. In the log of a UR5e in motion that the project's shared data hold (1,000 states, 125 a
// second), moving joints are 2e-4 to 4e-4 rad behind. A delay explains that: of target minus actual on the target's
// speed, least squares give 0.51, 0.44, 0.45, 0.51, 0.50 ms for joints 0 to 4, without a part that depends on the
// direction alone (below 1.1e-5 rad), and leave 5e-5 to 1.6e-4 rad. Here all joints have the mean, 0.48 ms, so that the
// tip stays on its line. A joint that stands still scatters by 2.3e-5 rad, speeds by 2e-3 to 4e-3 rad/s: independent
// normal noise here (options; speeds 50 times as much while it moves). Speeds are trapezoids, as in the log: level at
// the commanded 60 deg/s between straight ramps.
#include <cmath>
#include <map>

#include "tests/rig/controller/machine/machine_motion.h"

namespace touchstone::rig {
namespace {

constexpr double kFirstTimestampS = 60;  // whole cycles; some clients wait for a time stamp of 40 s

// UR's RTDE guide, safety_status_bits; 10: stopped by safety.
uint32_t SafetyBits(int mode) {
  constexpr uint32_t kStopped = 1u << 10;
  switch (mode) {
    case kNormal:
      return 1;
    case kReduced:
      return 1u << 1;
    case kProtectiveStop:
      return 1u << 2 | kStopped;
    case kRecovery:
      return 1u << 3 | kStopped;
    case kSafeguardStop:
      return 1u << 4 | kStopped;
    case kSystemEmergencyStop:
      return 1u << 5 | 1u << 7 | kStopped;
    case kRobotEmergencyStop:
      return 1u << 6 | 1u << 7 | kStopped;
    default:
      return kStopped;
  }
}

}  // namespace

// UR's client library, ur/datatypes.h; 23 is of ur_dashboard_msgs/SafetyStatus.
std::string SafetyModeName(int mode) {
  static const std::map<int, std::string> names = {{1, "NORMAL"},
                                                   {2, "REDUCED"},
                                                   {3, "PROTECTIVE_STOP"},
                                                   {4, "RECOVERY"},
                                                   {5, "SAFEGUARD_STOP"},
                                                   {6, "SYSTEM_EMERGENCY_STOP"},
                                                   {7, "ROBOT_EMERGENCY_STOP"},
                                                   {8, "VIOLATION"},
                                                   {9, "FAULT"},
                                                   {10, "VALIDATE_JOINT_ID"},
                                                   {11, "UNDEFINED_SAFETY_MODE"},
                                                   {12, "AUTOMATIC_MODE_SAFEGUARD_STOP"},
                                                   {13, "SYSTEM_THREE_POSITION_ENABLING_STOP"},
                                                   {14, "TP_THREE_POSITION_ENABLING_STOP"},
                                                   {15, "IMMI_EMERGENCY_STOP"},
                                                   {16, "IMMI_SAFEGUARD_STOP"},
                                                   {17, "PROFISAFE_WAITING_FOR_PARAMETERS"},
                                                   {18, "PROFISAFE_AUTOMATIC_MODE_SAFEGUARD_STOP"},
                                                   {19, "PROFISAFE_SAFEGUARD_STOP"},
                                                   {20, "PROFISAFE_EMERGENCY_STOP"},
                                                   {22, "SAFETY_API_SAFEGUARD_STOP"},
                                                   {23, "IO_PLANE_STOP"}};
  const auto found = names.find(mode);
  return found == names.end() ? "" : found->second;
}

Joints Machine::JointsAt(double time_s) const {
  if (past_ && time_s < past_end_s_) return past_->path->JointsAt(past_->profile->LengthAt(time_s));
  return motion_ ? motion_->path->JointsAt(motion_->profile->LengthAt(time_s)) : joints_;
}

Eigen::Isometry3d Machine::FlangeAt(double time_s) const {
  return BaseFromFlange(geometry_, JointsAt(time_s));
}

// Joints, their speeds and accelerations along a motion at one time.
struct Machine::JointMotion {
  Joints q, qd = Joints::Zero(), qdd = Joints::Zero();
};

Machine::JointMotion Machine::TargetAt(double time_s) const {
  JointMotion target{JointsAt(time_s)};
  const Motion* motion = past_ && time_s < past_end_s_ ? past_.get() : motion_.get();
  if (!motion) return target;
  const Joints direction = motion->path->Direction(motion->profile->LengthAt(time_s));
  target.qd = motion->profile->SpeedAt(time_s) * direction;
  target.qdd = motion->profile->AccelerationAt(time_s) * direction;
  return target;
}

Vector6 Machine::TipSpeed(const JointMotion& joints) const {
  Vector6 speed = Vector6::Zero();
  if (joints.qd.isZero(0)) return speed;
  const Eigen::Isometry3d flange = BaseFromFlange(geometry_, joints.q);
  speed = Jacobian(geometry_, joints.q) * joints.qd;
  const Eigen::Vector3d turning = speed.tail<3>();
  speed.head<3>() += turning.cross(flange.linear() * flange_from_tip_.translation());
  return speed;
}

// The fingers are springs; what they press back with acts on the tip against its axis.
Eigen::Vector3d Machine::ForceOnTip(const Eigen::Isometry3d& base_from_tip) const {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  if (!faults_) return force;
  if (tip_)
    force -= faults_->Get("finger_stiffness") * 1e3 * tip_->IndentationM() * base_from_tip.linear().col(2);
  force.z() -= faults_->Get("force_offset_n");
  return force;
}

RobotState Machine::State() {
  RobotState state;
  const double cycle_time_s = std::floor(now_s_ / cycle_s_ + 1e-6) * cycle_s_;
  state.timestamp_s = kFirstTimestampS + cycle_time_s - booted_at_s_;
  const JointMotion target = TargetAt(cycle_time_s),
                    actual = TargetAt(cycle_time_s - options_.following_lag_s);
  state.target_q = target.q, state.target_qd = target.qd, state.target_qdd = target.qdd;
  state.target_tcp_pose = ToPose(BaseFromFlange(geometry_, target.q) * flange_from_tip_);
  state.target_tcp_speed = TipSpeed(target);
  state.tcp_offset = ToPose(flange_from_tip_);

  std::normal_distribution<double> normal;
  const auto noise = [&](double sigma) { return sigma > 0 ? sigma * normal(random_) : 0.0; };
  const bool moves = !actual.qd.isZero(0);
  state.actual_q = actual.q;
  state.actual_qd = actual.qd;
  state.actual_tcp_pose = ToPose(BaseFromFlange(geometry_, actual.q) * flange_from_tip_);
  state.actual_tcp_speed = TipSpeed(actual);
  for (int i = 0; i < 6; ++i) {
    const double sigma = i < 3 ? options_.position_noise_m : options_.joint_noise_rad;
    state.actual_q[i] += noise(options_.joint_noise_rad);
    state.actual_qd[i] += moves ? noise(50 * options_.joint_noise_rad) : 0;
    state.actual_tcp_pose[i] += noise(sigma);
    state.actual_tcp_speed[i] += moves ? noise(50 * sigma) : 0;
    state.actual_tcp_force[i] = noise(options_.position_noise_m > 0 ? (i < 3 ? 0.3 : 0.01) : 0);
  }

  const Eigen::Isometry3d flange = BaseFromFlange(geometry_, actual.q);
  state.actual_tcp_force.head<3>() += ForceOnTip(flange * flange_from_tip_) - flange.linear() * force_zero_n_;

  state.robot_mode = robot_mode_;
  state.safety_mode = safety_mode_;
  state.runtime_state =
      script_ ? (paused_ ? (Moving() ? kPausing : kPaused) : kPlaying) : (motion_ ? kStopping : kStopped);
  state.program_running = program_running();
  state.robot_status_bits = (robot_mode_ >= kPowerOn ? 1u : 0u) | (program_running() ? 2u : 0u);
  state.safety_status_bits = SafetyBits(safety_mode_);
  state.speed_scaling = limiter_;
  state.target_speed_fraction = slider_;
  state.digital_inputs = digital_inputs();
  state.digital_outputs = digital_outputs_;
  state.payload_kg = payload_kg_;
  state.payload_cog_m = PayloadCog();
  // The elbow: where the upper arm ends.
  const double lift = state.target_q[1], turn = state.target_q[0];
  state.elbow_m << geometry_.a_m[1] * std::cos(lift) * std::cos(turn),
      geometry_.a_m[1] * std::cos(lift) * std::sin(turn),
      geometry_.d_m[0] + geometry_.a_m[1] * std::sin(lift);
  state.script_line = script_ ? script_->line() : 0;
  state.registers = registers_;
  return state;
}

}  // namespace touchstone::rig
