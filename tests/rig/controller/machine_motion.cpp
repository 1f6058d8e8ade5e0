#include "tests/rig/controller/machine_motion.h"

#include <algorithm>
#include <cmath>

#include "tests/rig/controller/never.h"
// Noise. In the log of a UR5e in motion that the project's shared data hold (125 samples a second), a joint
// that stands still scatters by 2.3e-5 rad about its target; moving joints lag by 2e-4 to 4e-4 rad and their
// speeds scatter by 2e-3 to 4e-3 rad/s. Speeds are trapezoids: level at the commanded 60 deg/s between
// straight ramps. Here "actual" is the target with independent normal noise (options; speeds 50 times as much
// while it moves), without lag, so that a test knows the truth.

namespace touchstone::rig {
namespace {

constexpr double kHaltLine = 5, kHaltJoints = 10;  // m/s^2, rad/s^2, of stops that nobody gave a number for
constexpr double kFarM = 2;                        // speedl goes on so far at most: beyond any reach
constexpr double kFirstTimestampS = 60;            // some clients wait for a time stamp of 40 s

}  // namespace

double Machine::NextMotionEventS() const {
  if (!motion_) return kNever;
  const double end_s = motion_->profile->EndS();
  return motion_->stopping ? end_s : std::min(end_s, motion_->profile->TimeOf(motion_->obstacle_at));
}

void Machine::Progress(double time_s) {
  last_progress_s_ = time_s;
  if (!motion_ || !motion_->number || !tip_) return;
  const Motion& motion = *motion_;
  const double pushed_m = tip_->OnProgress(motion.number, time_s, motion.TipDistance(time_s),
                                           [&motion](double at_s) { return motion.TipDistance(at_s); });
  if (pushed_m > options_.finger_give_m)
    ProtectiveStop(153, "C153A0 the position deviates from the path: a finger is pushed too far");
}

void Machine::FinishMotion(double time_s) {
  const double length = motion_->profile->EndLength();
  joints_ = motion_->path->JointsAt(length);
  const uint64_t number = motion_->number;
  motion_.reset();
  if (number && tip_) tip_->OnMotionEnded(number, time_s);
  changed_ = true;
}

void Machine::Halt() {
  if (!motion_ || motion_->stopping) return;
  motion_->stopping = true;
  motion_->acceleration = std::max(motion_->acceleration, motion_->line ? kHaltLine : kHaltJoints);
  motion_->profile->Stop(now_s_, motion_->acceleration);
}

void Machine::Rescale() {
  const double scaling = slider_ * (faults_ ? faults_->Get("speed_scaling") : 1);
  if (scaling == scaling_) return;
  scaling_ = scaling;
  if (motion_ && !motion_->stopping)
    motion_->profile->Cruise(now_s_, motion_->speed * scaling_, motion_->acceleration);
}

void Machine::RequireReady() const {
  if (in_secondary_) throw ScriptError("a secondary program cannot move the robot");
  if (robot_mode_ != kRunning) throw ScriptError("the robot is not running: it cannot move");
  if (safety_mode_ != kNormal) throw ScriptError("the safety mode is not normal: the robot cannot move");
}

bool Machine::MustWaitToMove(int thread, bool keeps_going) {
  RequireReady();
  if (!motion_) return false;
  const bool mine = motion_->thread == thread;
  if (motion_->thread >= 0 && !mine && script_ && script_->Lives(motion_->thread))
    throw ScriptError("another thread is already controlling the robot");
  if (mine && keeps_going && motion_->keeps_going && !motion_->stopping) return false;
  Halt();
  return true;
}

Outcome Machine::Begin(std::unique_ptr<Motion> motion, double speed, double acceleration, double duration_s,
                       double first_speed) {
  const double length = motion->path->Length();
  if (length <= 0) return {Outcome::Wait::kCycle, {}, 0};
  // A given duration counts instead of speed and acceleration: a fifth of it to speed up, a fifth
  // to slow down.
  if (duration_s > 0) {
    speed = length / (0.8 * duration_s);
    acceleration = speed / (0.2 * duration_s);
  }
  if (!(speed > 0) || !(acceleration > 0)) throw ScriptError("speed and acceleration must be above 0");
  motion->speed = speed;
  motion->acceleration = acceleration;
  // At a reduced speed scaling the same way is driven in stretched time: speed by s, acceleration
  // by its square.
  const double ramp = scaling_ > 0 ? acceleration * scaling_ * scaling_ : acceleration;
  motion->profile = std::make_unique<SpeedProfile>(now_s_, length, speed * scaling_, ramp, first_speed);
  if (const auto obstacle = motion->path->FirstObstacle(speed * scaling_, ramp)) {
    motion->obstacle_at = obstacle->length;
    motion->obstacle = obstacle->why;
  }
  ++motions_;
  motion_ = std::move(motion);
  last_progress_s_ = now_s_;
  if (motion_->line) {
    motion_->number = ++straight_motions_;
    if (tip_) {
      StraightMotion begun;
      begun.number = motion_->number;
      begun.start_s = now_s_;
      begun.from = motion_->line->from();
      begun.to = motion_->line->to();
      begun.speed_m_s = speed * scaling_ * motion_->line->MetresPerLength();
      begun.acceleration_m_s2 = ramp * motion_->line->MetresPerLength();
      tip_->OnMotionBegan(begun);
    }
  }
  return {Outcome::Wait::kRest, {}, 0};
}

Outcome Machine::MoveLine(const Eigen::Isometry3d& base_from_tip, double speed, double acceleration,
                          double duration_s, int thread) {
  if (MustWaitToMove(thread, false)) return {Outcome::Wait::kRetry, {}, 0};
  auto motion = std::make_unique<Motion>();
  auto line = std::make_unique<LinePath>(geometry_, joints_, flange_from_tip_, base_from_tip);
  motion->line = line.get();
  motion->path = std::move(line);
  motion->thread = thread;
  return Begin(std::move(motion), speed, acceleration, duration_s, 0);
}

Outcome Machine::MoveJoints(const Joints& joints, double speed, double acceleration, double duration_s,
                            int thread) {
  if (MustWaitToMove(thread, false)) return {Outcome::Wait::kRetry, {}, 0};
  auto motion = std::make_unique<Motion>();
  motion->path = std::make_unique<JointPath>(geometry_, joints_, joints);
  motion->thread = thread;
  return Begin(std::move(motion), speed, acceleration, duration_s, 0);
}

Outcome Machine::MoveAlong(const Vector6& twist, double acceleration, double duration_s, int thread) {
  const double linear = twist.head<3>().norm(), angular = twist.tail<3>().norm();
  // The measure of the line, as LinePath has it.
  const double speed = linear > kTurnOnly ? linear : std::max(linear, kMetresPerRadian * angular);
  if (speed <= 0) return StopMotion(acceleration);
  if (MustWaitToMove(thread, true)) return {Outcome::Wait::kRetry, {}, 0};
  double first_speed = 0;
  if (motion_) {  // goes over from the line before, at the speed that it has in the new direction
    const double old_speed = motion_->profile->SpeedAt(now_s_) * motion_->line->MetresPerLength();
    const Eigen::Vector3d along =
        (motion_->line->to().translation() - motion_->line->from().translation()).normalized();
    if (linear > 0)
      first_speed = std::max(0.0, old_speed * along.dot(twist.head<3>() / linear)) * speed / linear;
    Progress(now_s_);
    if (!motion_) return {Outcome::Wait::kRetry, {}, 0};
    motion_->profile->Hold(now_s_);
    FinishMotion(now_s_);
  }
  RequireReady();
  const Eigen::Isometry3d from = BaseFromFlange(geometry_, joints_) * flange_from_tip_;
  // A turn of at most 3 rad keeps the way to the end the short one.
  double far_s = kFarM / speed;
  if (angular > 0) far_s = std::min(far_s, 3 / angular);
  Eigen::Isometry3d to = from;
  to.translation() += far_s * twist.head<3>();
  if (angular > 0) {
    to.linear() =
        Eigen::AngleAxisd(far_s * angular, Eigen::Vector3d(twist.tail<3>() / angular)).toRotationMatrix() *
        from.linear();
  }
  auto motion = std::make_unique<Motion>();
  auto line = std::make_unique<LinePath>(geometry_, joints_, flange_from_tip_, to);
  motion->line = line.get();
  motion->path = std::move(line);
  motion->thread = thread;
  motion->keeps_going = true;
  Begin(std::move(motion), speed, acceleration, 0, first_speed);
  const double until_s =
      now_s_ + (duration_s > 0 ? duration_s : std::max(speed - first_speed, 0.0) / acceleration);
  return {Outcome::Wait::kUntil, {}, until_s};
}

Outcome Machine::StopMotion(double deceleration) {
  if (in_secondary_) throw ScriptError("a secondary program cannot move the robot");
  if (!(deceleration > 0)) throw ScriptError("a deceleration must be above 0");
  if (!motion_) return {Outcome::Wait::kCycle, {}, 0};
  if (!motion_->stopping) {
    motion_->stopping = true;
    motion_->acceleration = deceleration;
    motion_->profile->Stop(now_s_, deceleration);
  }
  return {Outcome::Wait::kRest, {}, 0};
}

Joints Machine::JointsAt(double time_s) const {
  return motion_ ? motion_->path->JointsAt(motion_->profile->LengthAt(time_s)) : joints_;
}

Eigen::Isometry3d Machine::FlangeAt(double time_s) const {
  return BaseFromFlange(geometry_, JointsAt(time_s));
}

RobotState Machine::State() {
  RobotState state;
  state.timestamp_s = kFirstTimestampS + now_s_;
  state.target_q = JointsAt(now_s_);
  state.target_qd = state.target_qdd = Joints::Zero();
  if (motion_) {
    const double length = motion_->profile->LengthAt(now_s_);
    const Joints direction = motion_->path->Direction(length);
    state.target_qd = motion_->profile->SpeedAt(now_s_) * direction;
    state.target_qdd = motion_->profile->AccelerationAt(now_s_) * direction;
  }
  const Eigen::Isometry3d flange = BaseFromFlange(geometry_, state.target_q);
  const Eigen::Isometry3d tip = flange * flange_from_tip_;
  state.target_tcp_pose = ToPose(tip);
  state.tcp_offset = ToPose(flange_from_tip_);
  Vector6 speed = Vector6::Zero();
  if (motion_) {
    speed = Jacobian(geometry_, state.target_q) * state.target_qd;
    const Eigen::Vector3d turning = speed.tail<3>();
    speed.head<3>() += turning.cross(tip.translation() - flange.translation());
  }
  state.target_tcp_speed = speed;

  std::normal_distribution<double> normal;
  const auto noise = [&](double sigma) { return sigma > 0 ? sigma * normal(random_) : 0.0; };
  state.actual_q = state.target_q;
  state.actual_qd = state.target_qd;
  state.actual_tcp_pose = state.target_tcp_pose;
  state.actual_tcp_speed = speed;
  for (int i = 0; i < 6; ++i) {
    const double sigma = i < 3 ? options_.position_noise_m : options_.joint_noise_rad;
    state.actual_q[i] += noise(options_.joint_noise_rad);
    state.actual_qd[i] += motion_ ? noise(50 * options_.joint_noise_rad) : 0;
    state.actual_tcp_pose[i] += noise(sigma);
    state.actual_tcp_speed[i] += motion_ ? noise(50 * sigma) : 0;
    state.actual_tcp_force[i] = noise(options_.position_noise_m > 0 ? (i < 3 ? 0.3 : 0.01) : 0);
  }

  // The fingers are springs; what they press back with acts on the tip against its axis.
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  if (tip_ && faults_)
    force -= faults_->Get("finger_stiffness") * 1e3 * tip_->IndentationM() * tip.linear().col(2);
  if (faults_) force.z() -= faults_->Get("force_offset_n");
  state.actual_tcp_force.head<3>() += force;

  state.robot_mode = robot_mode_;
  state.safety_mode = safety_mode_;
  state.runtime_state = script_ ? kPlaying : motion_ ? kStopping : kStopped;
  state.program_running = script_ != nullptr;
  state.robot_status_bits = (robot_mode_ >= kPowerOn ? 1u : 0u) | (script_ ? 2u : 0u);
  state.safety_status_bits = safety_mode_ == kNormal           ? 1u
                             : safety_mode_ == kProtectiveStop ? (1u << 2) | (1u << 10)
                                                               : (1u << 6) | (1u << 7) | (1u << 10);
  state.speed_scaling = scaling_;
  state.target_speed_fraction = slider_;
  state.digital_inputs = digital_inputs();
  state.digital_outputs = digital_outputs_;
  state.payload_kg = payload_kg_;
  state.payload_cog_m = payload_cog_m_;
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
