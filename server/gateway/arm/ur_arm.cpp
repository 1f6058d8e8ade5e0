#include "server/gateway/arm/ur_arm.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>

#include <chrono>
#include <cmath>

#include "server/base/status.h"
#include "server/gateway/arm/motion/cartesian_speed.h"
#include "server/gateway/arm/ur_arm_on_tcp.h"
#include "server/gateway/arm/ur_modes.h"

namespace touchstone::gateway::arm {
namespace {

constexpr double kHistoryS = 30;                              // rig time
constexpr double kStopConnectS = 0.3, kStopDashboardS = 0.5;  // host time
constexpr double kDashboardS = 2;                             // host time
constexpr size_t kSentProgramsKept = 64;  // what the controller tells of a program comes at once
constexpr std::chrono::milliseconds kStartGoesOut{
    5};  // what a stop waits for a start that is just being sent
constexpr double kPowerOnRigS = 40, kPowerOnHostS = 20;  // the controller boots its arm in rig time

// "def touch_7():\n ..." -> "touch_7"
std::string ProgramName(const std::string& program) {
  const size_t begin = program.find("def ") + 4;
  return program.substr(begin, program.find('(', begin) - begin);
}

// For when the program ports are gone. A controller on which nothing runs answers that it failed to stop; whether
// that is why, it says itself.
absl::Status StopOverDashboard(const std::string& address, int port) {
  DashboardClient dashboard(address, port);  // nobody else waits for this one
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string reply, dashboard.Ask("stop", kStopDashboardS));
  if (absl::StartsWith(reply, "Stopped")) return absl::OkStatus();
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string running, dashboard.Ask("running", kStopDashboardS));
  if (absl::EqualsIgnoreCase(running, "Program running: false")) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat("the controller answers 'stop' with '",
                                                    reply.substr(0, 200), "' and 'running' with '",
                                                    running.substr(0, 200), "'"));
}

}  // namespace

UrArmOnTcp::UrArmOnTcp(const UrArmOptions& options, const UrKinematics& nominal,
                       timing::ChangeNotifier* changes)
    : options_(options),
      changes_(changes),
      nominal_(nominal),
      body_(options.body_limits, options.calibration),
      tip_from_flange_(options.script.flange_from_tip.inverse()),
      history_(kHistoryS, static_cast<size_t>(1.5 * kHistoryS * nominal.model().rtde_hz)),
      clock_(options.script.time_scale),
      dashboard_(options.address, options.dashboard_port),
      primary_(options.address, options.primary_port,
               [this](const PrimaryUpdate& update) { OnPrimary(update); }),
      programs_(options.address, options.secondary_port, nullptr),
      stops_(options.address, options.secondary_port, nullptr),
      rtde_(
          {options.address, options.rtde_port, nominal.model().rtde_hz, 4 * options.frozen_after_s + 1},
          [this](const RtdeSample& sample, double host_s) { OnSample(sample, host_s); },
          [this] { changes_->Notify(); }) {}

absl::Status UrArmOnTcp::SendStart(const StartGuard& guard, const std::function<absl::Status()>& send) {
  std::lock_guard<std::timed_mutex> lock(start_mutex_);
  if (guard != nullptr) TOUCHSTONE_RETURN_IF_ERROR(guard());
  return send();
}

absl::Status UrArmOnTcp::Begin(uint32_t program_id, const std::string& program, const StartGuard& guard) {
  if (program_id == 0 || program_id >= 1u << 28)
    return absl::InvalidArgumentError(
        absl::StrCat("program id ", program_id, ": must be from 1 to ", (1u << 28) - 1));
  // The registers keep what the last program wrote, also one of another gateway: its "done" is not this one's.
  if (const absl::StatusOr<ArmState> now = State(); now.ok() && now->program_id == program_id)
    return absl::FailedPreconditionError(absl::StrCat("the controller's registers show program ", program_id,
                                                      " already, so the end of a new one of that id could "
                                                      "not be told from the old one's: take another id"));
  bool permitted = false;
  // Before the guard is asked: a stop after its answer that does not wait until the program has gone out is seen below.
  const uint64_t stops = stop_count_;
  const absl::Status sent = SendStart(guard, [&] {
    permitted = true;
    withhold_heartbeats_ = false;
    {
      std::lock_guard<std::mutex> lock(mutex_);
      start_ = Start{program_id, timing::HostNowS(), "", false};
      sent_programs_.push_back(ProgramName(program));
      if (sent_programs_.size() > kSentProgramsKept) sent_programs_.pop_front();
    }
    SendHeartbeat();
    // A stop that did not wait until the program had gone out must reach the controller behind it.
    return programs_.Send(program, [&] { return stop_count_ != stops ? StopProgram() : std::string(); });
  });
  if (!permitted) return sent;
  const bool stopped = stop_count_ != stops;
  if (stopped || !sent.ok()) {
    std::lock_guard<std::mutex> lock(mutex_);
    if (start_.program_id == program_id) start_ = Start();
  }
  if (!stopped) return sent;
  SendStop().IgnoreError();
  return absl::AbortedError(absl::StrCat("program ", program_id, " was stopped before it began"));
}

UrKinematics UrArmOnTcp::Kinematics() const {
  const std::optional<DhTable> own = CalibratedKinematics();
  if (!own.has_value()) return nominal_;
  absl::StatusOr<UrKinematics> calibrated = nominal_.Calibrated(*own);
  return calibrated.ok() ? *calibrated
                         : nominal_;  // nothing is planned, and so sent, with those of another arm
}

std::vector<double> UrArmOnTcp::Speeds(const ArmState& from, const std::vector<Eigen::Isometry3d>& path,
                                       Joints* joints) const {
  const UrKinematics kinematics = Kinematics();
  std::vector<double> speeds_m_s;
  *joints = from.joints_rad;
  Eigen::Isometry3d at = from.base_from_tip;
  for (const Eigen::Isometry3d& pose : path) {
    speeds_m_s.push_back(LimitedCartesianSpeed(kinematics, body_, tip_from_flange_, at, pose,
                                               options_.script.transit_speed_m_s, joints));
    at = pose;
  }
  return speeds_m_s;
}

absl::Status UrArmOnTcp::StartTouch(const ArmTouch& touch, const StartGuard& guard) {
  if (touch.transit.empty()) return absl::InvalidArgumentError("a touch needs a start");
  if (!(touch.speed_m_s > 0)) return absl::InvalidArgumentError("a touch needs a speed above 0");
  TOUCHSTONE_RETURN_IF_ERROR(Ready());
  TOUCHSTONE_ASSIGN_OR_RETURN(const ArmState now, State());
  std::vector<Eigen::Isometry3d> path = touch.transit;
  path.push_back(touch.end);  // the speed of the retract
  Joints joints;
  return Begin(touch.program_id, TouchProgram(touch, Speeds(now, path, &joints), options_.script), guard);
}

absl::Status UrArmOnTcp::MoveThrough(uint32_t program_id, const std::vector<Eigen::Isometry3d>& poses,
                                     const std::vector<std::array<double, 6>>& joints,
                                     const StartGuard& guard) {
  TOUCHSTONE_RETURN_IF_ERROR(Ready());
  TOUCHSTONE_ASSIGN_OR_RETURN(const ArmState now, State());
  Joints at;
  const std::vector<double> speeds_m_s = Speeds(now, poses, &at);
  std::vector<double> speeds_rad_s;
  for (const Joints& next : joints) {
    speeds_rad_s.push_back(
        LimitedJointSpeed(Kinematics(), body_, at, next, options_.script.joint_speed_rad_s));
    at = next;
  }
  return Begin(program_id, MoveProgram(program_id, poses, speeds_m_s, joints, speeds_rad_s, options_.script),
               guard);
}

absl::Status UrArmOnTcp::StartFreedrive(uint32_t program_id, const StartGuard& guard) {
  TOUCHSTONE_RETURN_IF_ERROR(Ready());
  return Begin(program_id, FreedriveProgram(program_id, nominal_.model().e_series, options_.script), guard);
}

absl::Status UrArmOnTcp::Command(uint32_t program_id, int command) {
  std::lock_guard<std::mutex> lock(inputs_mutex_);
  command_ = CommandWord(program_id, command);
  return WriteHeartbeat();
}

void UrArmOnTcp::SendHeartbeat() {
  if (withhold_heartbeats_) return;
  std::lock_guard<std::mutex> lock(inputs_mutex_);
  WriteHeartbeat().IgnoreError();  // State() reports a lost link
}

absl::Status UrArmOnTcp::WriteHeartbeat() {
  heartbeat_ = (heartbeat_ + 1) & 0x7fffffff;
  sent_heartbeats_.Sent(heartbeat_, timing::HostNowS());
  return rtde_.WriteInputs(heartbeat_, command_);
}

absl::Status UrArmOnTcp::SendStop() {
  absl::Status status = stops_.TrySend(StopProgram());
  // The second way arrives behind every program that was sent before, whatever the controller does
  // with the first.
  const absl::Status behind = programs_.TrySend(StopProgram());
  if (status.ok() || behind.ok()) return absl::OkStatus();
  const auto fresh = TcpSocket::Connect(options_.address, options_.secondary_port, kStopConnectS);
  if (fresh.ok()) {
    status = (*fresh)->Send(StopProgram(), kStopConnectS);
    if (status.ok()) return status;
  }
  return StopOverDashboard(options_.address, options_.dashboard_port);
}

absl::Status UrArmOnTcp::Stop() {
  {
    // Behind what is just going out; what was not asked for yet finds the rig stopped.
    const std::unique_lock<std::timed_mutex> lock(start_mutex_, kStartGoesOut);
    ++stop_count_;
  }
  // The watchdog ends what does not heed the stop.
  withhold_heartbeats_ = true;
  const absl::Status status = SendStop();
  {
    std::lock_guard<std::mutex> lock(mutex_);
    start_ = Start();
  }
  changes_->Notify();
  if (status.ok()) return status;
  return absl::UnavailableError(absl::StrCat(
      "the stop could not be sent to the controller at ", options_.address, " (", status.message(),
      "): its watchdog stops a running program soon; press the emergency stop if anything moves"));
}

absl::Status UrArmOnTcp::StopOtherwise() {
  return StopOverDashboard(options_.address, options_.dashboard_port);
}

absl::Status UrArmOnTcp::DemandPower(const std::string& command, const std::string& expected,
                                     const StartGuard& guard, bool* sent) {
  bool reached = false;
  absl::Status status =
      dashboard_.Demand(command, expected, kDashboardS, [&](const std::function<absl::Status()>& send) {
        reached = true;
        return SendStart(guard, [&] {
          *sent = true;  // a demand without an answer may have been heard
          return send();
        });
      });
  if (!status.ok() && !reached)
    status = absl::Status(status.code(),
                          absl::StrCat(status.message(),
                                       "; enable the dashboard server (PolyScope 5.10 and later: Settings, "
                                       "Security, Services), or power the arm on at the teach pendant "
                                       "(PolyScope X has no dashboard server)"));
  return status;
}

absl::Status UrArmOnTcp::PowerOffAgain(const absl::Status& why) {
  const absl::Status off = dashboard_.Demand("power off", "Powering off", kDashboardS);
  return absl::Status(why.code(),
                      absl::StrCat(why.message(),
                                   off.ok() ? "; the arm, which was just being powered up, was powered off"
                                            : "; the arm, which was just being powered up, could not be "
                                              "powered off and may release its brakes: ",
                                   off.ok() ? "" : off.message()));
}

absl::Status UrArmOnTcp::PowerOn(const StartGuard& guard) {
  bool began = false;
  const absl::Status status = TakePowerSteps(guard, &began);
  return !status.ok() && began && !guard().ok() ? PowerOffAgain(status) : status;
}

absl::Status UrArmOnTcp::TakePowerSteps(const StartGuard& guard, bool* began) {
  const double until_s = timing::HostNowS() + kPowerOnHostS + kPowerOnRigS / options_.script.time_scale;
  bool powered = false, released = false;
  while (true) {
    const uint64_t seen = changes_->count();
    TOUCHSTONE_ASSIGN_OR_RETURN(const ArmState state, State());
    // After the state is known: released brakes that a stop came before are no success.
    TOUCHSTONE_RETURN_IF_ERROR(guard());
    if (state.robot_mode == RobotMode::kRunning) return SafetyPermitsMotion(state.safety_mode);
    TOUCHSTONE_RETURN_IF_ERROR(SafetyPermitsMotion(state.safety_mode));
    // "power on" is valid from POWER_OFF alone; what boots or connects is waited for.
    if (!powered && state.robot_mode == RobotMode::kPowerOff) {
      TOUCHSTONE_RETURN_IF_ERROR(DemandPower("power on", "Powering on", guard, began));
      powered = true;
    } else if (!released && state.robot_mode == RobotMode::kIdle) {
      TOUCHSTONE_RETURN_IF_ERROR(DemandPower("brake release", "Brake releasing", guard, began));
      released = true;
    }
    if (state.robot_mode == RobotMode::kConfirmSafety || state.robot_mode == RobotMode::kBackdrive)
      return absl::FailedPreconditionError(
          absl::StrCat("the arm's mode is ", RobotModeName(state.robot_mode),
                       ", and only a person at the teach pendant ends that; then power it on"));
    if (timing::HostNowS() > until_s)
      return absl::UnavailableError(absl::StrCat("the arm's mode is still ", RobotModeName(state.robot_mode),
                                                 *began ? " although it was powered on" : "",
                                                 ", RUNNING is needed: look at the teach pendant"));
    changes_->WaitForChange(seen, 0.1);
  }
}

absl::StatusOr<std::unique_ptr<UrArm>> ConnectUrArm(const UrArmOptions& options,
                                                    timing::ChangeNotifier* changes) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const UrKinematics nominal, UrKinematics::ForModel(options.model));
  if (options.address.empty()) return absl::InvalidArgumentError("arm: the controller's address is missing");
  for (const int port :
       {options.dashboard_port, options.primary_port, options.secondary_port, options.rtde_port}) {
    if (port < 1 || port > 65535)
      return absl::InvalidArgumentError(absl::StrCat("arm: port ", port, " must be from 1 to 65535"));
  }
  if (!(options.script.time_scale > 0) || !(options.frozen_after_s > 0))
    return absl::InvalidArgumentError("arm: time_scale and frozen_after_s must be above 0");
  auto arm = std::make_unique<UrArmOnTcp>(options, nominal, changes);
  const double until_s = timing::HostNowS() + options.connect_wait_s;
  while ((!arm->State().ok() || !arm->ProgramPortsConnected()) && timing::HostNowS() < until_s) {
    const uint64_t seen = changes->count();
    changes->WaitForChange(seen, 0.01);
  }
  return std::unique_ptr<UrArm>(std::move(arm));
}

}  // namespace touchstone::gateway::arm
