#include "tests/rig/controller/machine/machine.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/rig/controller/machine/machine_motion.h"
#include "tests/rig/controller/never.h"

namespace touchstone::rig {
namespace {

constexpr double kControllerBootsS = 3, kPowerOnS = 1.0, kBootS = 1.5, kBrakesS = 1.0, kUnlockS = 0.5;
constexpr double kUnlockAfterS = 5, kDashboardLagS = 0.6;
// A late host catches up with that many control cycles of a waiting program at most; the rest are skipped.
constexpr double kMaxCyclesAtOnce = 8;
constexpr double kProgressEveryM = 0.002;
constexpr int kMaxProgressSteps = 64;

}  // namespace

Machine::Machine(const ControllerOptions& options, Faults* faults, TipListener* tip)
    : options_(options),
      faults_(faults),
      tip_(tip),
      geometry_(options.calibrated ? CalibratedGeometry(GeometryOf(options.model))
                                   : GeometryOf(options.model)),
      cycle_s_(options.model == "ur3" ? 0.008 : 0.002),
      random_(options.seed) {
  for (int i = 0; i < 6; ++i) joints_[i] = options.joints_rad[i];
  if (options.powered) robot_mode_ = kRunning;
  safety_history_ = {{-kNever, kNormal}};
}

Machine::~Machine() = default;

void Machine::Later(double seconds, std::function<void()> action) {
  later_.push_back({CycleAtOrAfter(now_s_ + seconds), std::move(action)});
}

double Machine::NextEventS() const {
  if (frozen_) return kNever;
  double next = std::min(NextMotionEventS(), NextScriptS());
  for (const auto& [time_s, action] : later_) next = std::min(next, time_s);
  if (script_ && !paused_)
    for (const Watchdog& watchdog : watchdogs_)
      if (watchdog.action != Watchdog::kIgnore) next = std::min(next, watchdog.fed_s + watchdog.period_s);
  return next;
}

bool Machine::NeedsCycles() const {
  return !frozen_ && (motion_ || (script_ && !paused_ && script_->NextCycleS() < kNever));
}

double Machine::CycleAtOrAfter(double time_s) const {
  return std::ceil(time_s / cycle_s_ - 1e-6) * cycle_s_;
}

bool Machine::OnCycle(double time_s) const {
  const double cycles = time_s / cycle_s_;
  return std::abs(cycles - std::round(cycles)) < 1e-5;
}

bool Machine::Moving() const {
  if (script_ && !paused_ && (script_fresh_ || (!motion_ && script_->WaitsForRest()))) return true;
  return motion_ && !(paused_ && !motion_->stopping && motion_->profile->SpeedAt(now_s_) == 0);
}

void Machine::Advance(double now_s, const std::function<void()>& changed) {
  if (frozen_) return;
  for (;;) {
    double next = std::min(NextMotionEventS(), NextScriptS());
    for (const auto& [time_s, action] : later_) next = std::min(next, time_s);
    if (script_ && !paused_) {
      const double others_s = std::min(next, now_s);
      if (others_s - script_->NextCycleS() > kMaxCyclesAtOnce * cycle_s_)
        script_->SkipCyclesTo(CycleAtOrAfter(others_s - cycle_s_));
      if (script_->NextCycleS() < kNever)
        next = std::min(next, std::max(CycleAtOrAfter(std::max(script_->NextCycleS(), now_s_)), now_s_));
    }
    if (motion_ && motion_->number) {
      const double speed = std::max(DrivenSpeed(*motion_) * motion_->line->MetresPerLength(), 1e-9);
      next = std::min(
          next, last_progress_s_ + std::max(kProgressEveryM / speed, (now_s - now_s_) / kMaxProgressSteps));
    }
    if (next > now_s) break;
    now_s_ = std::max(now_s_, next);
    Progress(now_s_);
    if (motion_ && motion_->profile->EndS() <= now_s_) {
      FinishMotion(now_s_);
    } else if (motion_ && !motion_->stopping && motion_->profile->TimeOf(motion_->obstacle_at) <= now_s_) {
      ProtectiveStop(0, motion_->obstacle);
    }
    for (size_t i = 0; i < later_.size(); ++i) {
      if (later_[i].first > now_s_) continue;
      const auto action = std::move(later_[i].second);
      later_.erase(later_.begin() + i--);
      action();
    }
    if (!OnCycle(now_s_)) continue;
    RunScript();
    Tell(changed);
  }
  now_s_ = std::max(now_s_, now_s);
  Progress(now_s_);
  LookAtFaults();
  Tell(changed);
}

void Machine::Tell(const std::function<void()>& changed) {
  if (changed_ && changed) changed();
  changed_ = false;
}

void Machine::Freeze(double now_s) {
  if (frozen_) return;
  frozen_ = true;
  frozen_at_s_ = now_s;
  if (motion_) motion_->profile->Hold(now_s);
}

void Machine::Thaw(double now_s) {
  if (!frozen_) return;
  frozen_ = false;
  now_s_ = std::max(now_s_, now_s);
  last_progress_s_ = now_s_;
  for (Watchdog& watchdog : watchdogs_) watchdog.fed_s += now_s - frozen_at_s_;
  if (!motion_) return;
  if (motion_->stopping) motion_->profile->Stop(now_s_, motion_->acceleration);
  DriveOn();
}

void Machine::LosePower() {
  PowerOff();
  registers_ = {};
  flange_from_tip_ = Eigen::Isometry3d::Identity();
  payload_kg_ = 0;
  payload_cog_m_ = Eigen::Vector3d::Zero();
  force_zero_n_.setZero();
  SetSafety(kNormal);
  announcements_.clear();
}

void Machine::Boot(double now_s) {
  now_s_ = std::max(now_s_, now_s);
  booted_at_s_ = CycleAtOrAfter(now_s_);
  robot_mode_ = kBooting;
  Later(kControllerBootsS, [this] {
    robot_mode_ = kPowerOff;
    changed_ = true;
  });
}

void Machine::PowerOn() {
  if (robot_mode_ != kPowerOff || emergency_) return;
  later_.clear();
  Later(kPowerOnS, [this] {
    robot_mode_ = kPowerOn;
    changed_ = true;
    Later(kBootS, [this] {
      robot_mode_ = kIdle;
      changed_ = true;
    });
  });
}

void Machine::ReleaseBrakes() {
  if (robot_mode_ == kRunning || robot_mode_ == kBooting || emergency_) return;
  later_.clear();
  const double wait_s = robot_mode_ == kIdle ? 0 : robot_mode_ == kPowerOn ? kBootS : kPowerOnS + kBootS;
  if (robot_mode_ == kPowerOff) Later(kPowerOnS, [this] { robot_mode_ = kPowerOn; });
  Later(wait_s, [this] { robot_mode_ = kIdle; });
  Later(wait_s + kBrakesS, [this] {
    robot_mode_ = kRunning;
    changed_ = true;
  });
}

void Machine::PowerOff() {
  later_.clear();
  if (script_) EndProgram();
  // Without power the brakes hold at once.
  if (motion_) {
    Progress(now_s_);
    motion_->profile->Stop(now_s_, 1e9);
    FinishMotion(now_s_);
  }
  robot_mode_ = kPowerOff;
  changed_ = true;
}

void Machine::SetSafety(int mode) {
  safety_mode_ = mode;
  safety_history_.push_back({now_s_, mode});
  if (safety_history_.size() > 64) safety_history_.erase(safety_history_.begin());
  changed_ = true;
}

int Machine::LaggingSafetyMode() const {
  int mode = safety_history_.front().second;
  for (const auto& [since_s, each] : safety_history_)
    if (since_s <= now_s_ - kDashboardLagS) mode = each;
  return mode;
}

void Machine::ProtectiveStop(int code, const std::string& why) {
  if (!SafetyPermitsMotion()) return;
  ++protective_stops_;
  stopped_at_s_ = now_s_;
  SetSafety(kProtectiveStop);
  Announce({Announcement::kError, "", why, code, 0});
  PauseForSafety();
  // What it would collide with lies ahead: the motion is given up, and a program that goes on begins its next one.
  Halt();
}

void Machine::PauseForSafety() {
  if (!script_ || paused_) return;
  paused_ = changed_ = true;
  DriveOn();
}

void Machine::TakeSafetyMode(int mode) {
  if (mode == kSystemEmergencyStop || mode == kRobotEmergencyStop || mode == kImmiEmergencyStop ||
      mode == kProfisafeEmergencyStop)
    return EmergencyStop(mode);
  emergency_ = false;
  SetSafety(mode);
  if (!SafetyPermitsMotion()) PauseForSafety();
}

bool Machine::LocalControl() const {
  return options_.model != "ur3" && faults_ && faults_->Get("local_control") != 0;
}

bool Machine::OldSoftware() const {
  return faults_ && faults_->Get("old_software") != 0;
}

bool Machine::Unlock() {
  if (safety_mode_ != kProtectiveStop) return true;
  if (now_s_ < stopped_at_s_ + kUnlockAfterS) return false;
  Later(kUnlockS, [this] {
    if (safety_mode_ == kProtectiveStop) SetSafety(kNormal);
  });
  return true;
}

void Machine::EmergencyStop(int mode) {
  emergency_ = true;
  PowerOff();
  SetSafety(mode);
}

void Machine::LookAtFaults() {
  if (!faults_) return;
  if (faults_->Take("protective_stop") != 0) ProtectiveStop(153, "emulated protective stop");
  const int wanted = faults_->Get("emergency_stop") != 0 ? static_cast<int>(kRobotEmergencyStop)
                                                         : static_cast<int>(faults_->Get("safety_mode"));
  if (wanted != safety_fault_) TakeSafetyMode(wanted);
  safety_fault_ = wanted;
  Rescale();
}

void Machine::WriteOutput(int index, int32_t value) {
  changed_ |= registers_.output_int[index] != value;
  registers_.output_int[index] = value;
}

void Machine::WriteOutput(int index, double value) {
  changed_ |= registers_.output_double[index] != value;
  registers_.output_double[index] = value;
}

void Machine::WriteOutput(int index, bool value) {
  changed_ |= registers_.output_bit[index] != value;
  registers_.output_bit[index] = value;
}

void Machine::SetDigitalOutputs(uint32_t mask, uint32_t values) {
  digital_outputs_ = (digital_outputs_ & ~static_cast<uint64_t>(mask)) | (values & mask);
}

void Machine::SetTool(const Eigen::Isometry3d& flange_from_tip) {
  flange_from_tip_ = flange_from_tip;
}

void Machine::SetPayload(double kg, const std::optional<Eigen::Vector3d>& cog_m) {
  payload_kg_ = kg;
  payload_cog_m_ = cog_m;
  ZeroForceSensor();
}

void Machine::ZeroForceSensor() {
  if (!e_series()) return;
  const Eigen::Isometry3d flange = ActualFlangeAt(now_s_);
  force_zero_n_ = flange.linear().transpose() * ForceOnTip(flange * flange_from_tip_);
}

void Machine::Announce(Announcement announcement) {
  if (announcements_.size() < 1000) announcements_.push_back(std::move(announcement));
}

std::vector<Announcement> Machine::TakeAnnouncements() {
  return std::exchange(announcements_, {});
}

uint64_t Machine::Count(const std::string& what) const {
  if (what == "programs") return programs_;
  if (what == "motions") return motions_;
  if (what == "protective_stops") return protective_stops_;
  if (what == "watchdog_stops") return watchdog_stops_;
  return 0;
}

}  // namespace touchstone::rig
