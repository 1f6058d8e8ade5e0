#include "tests/rig/controller/machine/machine_motion.h"

#include <algorithm>
#include <cmath>

#include "tests/rig/controller/never.h"

namespace touchstone::rig {
namespace {

constexpr double kHaltLine = 5, kHaltJoints = 10;  // m/s^2, rad/s^2, of stops that nobody gave a number for
constexpr double kFarM = 2;                        // speedl goes on so far at most: beyond any reach

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
  past_ = std::move(motion_);
  past_end_s_ = time_s;
  script_due_s_ = CycleAtOrAfter(time_s);
  if (number && tip_) tip_->OnMotionEnded(number, time_s);
  changed_ = true;
}

void Machine::Halt() {
  if (!motion_ || motion_->stopping) return;
  motion_->stopping = true;
  motion_->acceleration = std::max(motion_->acceleration, motion_->line ? kHaltLine : kHaltJoints);
  motion_->profile->Stop(now_s_, motion_->acceleration);
}

double Machine::DrivenSpeed(const Motion& motion) const {
  return paused_ ? 0 : motion.speed * limiter_ * slider_;
}

void Machine::DriveOn() {
  if (motion_ && !motion_->stopping)
    motion_->profile->Cruise(now_s_, DrivenSpeed(*motion_), motion_->acceleration);
}

void Machine::Rescale() {
  const double before = limiter_ * slider_;
  if (faults_) {
    limiter_ = faults_->Get("speed_scaling");
    const double slider = faults_->Get("speed_slider");
    if (slider != slider_fault_) slider_ = slider_fault_ = slider;
  }
  if (limiter_ * slider_ != before) DriveOn();
}

// What a client writes and what a person sets at the pendant is one slider: the last one counts.
void Machine::SetSpeedSlider(double fraction) {
  slider_ = std::clamp(fraction, 0.0, 1.0);
  DriveOn();
}

void Machine::RequireReady() const {
  if (in_secondary_) throw ScriptError("a secondary program cannot move the robot");
  if (robot_mode_ != kRunning) throw ScriptError("the robot is not running: it cannot move");
  if (!SafetyPermitsMotion()) throw ScriptError("the safety mode is not normal: the robot cannot move");
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
  const double scaling = limiter_ * slider_, driven = DrivenSpeed(*motion);
  const double ramp = scaling > 0 ? acceleration * scaling * scaling : acceleration;
  motion->lag_s = options_.following_lag_s;
  motion->profile = std::make_unique<SpeedProfile>(now_s_, length, driven, ramp, first_speed);
  if (const auto obstacle = motion->path->FirstObstacle(driven, ramp)) {
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
      begun.start_s = now_s_ + motion_->lag_s;
      begun.from = motion_->line->from();
      begun.to = motion_->line->to();
      begun.speed_m_s = driven * motion_->line->MetresPerLength();
      begun.acceleration_m_s2 = ramp * motion_->line->MetresPerLength();
      tip_->OnMotionBegan(begun);
    }
  }
  return {Outcome::Wait::kRest, {}, 0};
}

bool Machine::TakesTheLongerTurn() {
  if (!faults_) return false;
  return std::uniform_real_distribution<double>()(random_) < faults_->Get("half_turn_longer");
}

Outcome Machine::MoveLine(const Eigen::Isometry3d& base_from_tip, double speed, double acceleration,
                          double duration_s, int thread) {
  if (MustWaitToMove(thread, false)) return {Outcome::Wait::kRetry, {}, 0};
  auto motion = std::make_unique<Motion>();
  auto line = std::make_unique<LinePath>(geometry_, joints_, flange_from_tip_, base_from_tip);
  if (line->TurnRad() >= kHalfTurnFromRad && TakesTheLongerTurn())
    line = std::make_unique<LinePath>(geometry_, joints_, flange_from_tip_, base_from_tip, LineTurn::kLonger);
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

void Machine::SetFreedrive(bool on) {
  if (on) RequireReady();
  if (on && motion_) throw ScriptError("the robot moves: it cannot be freed");
  free_ = on;
}

bool Machine::MoveByHand(const Joints& joints) {
  if (!free_ || motion_) return false;
  joints_ = joints;
  return true;
}

}  // namespace touchstone::rig
