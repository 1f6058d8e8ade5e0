#include "server/gateway/arm/ur_arm.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <atomic>
#include <cmath>
#include <mutex>

#include "server/base/status.h"
#include "server/gateway/arm/cartesian_speed.h"
#include "server/gateway/arm/dashboard_client.h"
#include "server/gateway/arm/registers.h"
#include "server/gateway/arm/rtde_client.h"
#include "server/gateway/arm/script_port.h"
#include "server/gateway/arm/state_history.h"
#include "server/gateway/arm/ur_modes.h"
#include "server/geometry/pose.h"

namespace touchstone {
namespace {

constexpr double kHistoryS = 30;                              // rig time
constexpr double kStopConnectS = 0.3, kStopDashboardS = 0.5;  // host time
constexpr double kDashboardS = 2;                             // host time
constexpr double kPowerOnRigS = 40, kPowerOnHostS = 20;       // the controller boots its arm in rig time

double RateOf(const std::string& model) {
  return model == "ur3" ? 125 : 500;
}

// When the last heartbeats were sent, host time.
class SentHeartbeats {
 public:
  void Sent(int32_t heartbeat, double host_s) {
    std::lock_guard<std::mutex> lock(mutex_);
    sent_[heartbeat % kKept] = {heartbeat, host_s};
  }
  // When that heartbeat was sent, the first time that it is asked for; 0 afterwards, and if it is not known.
  double TakeSendingOf(int32_t heartbeat) {
    std::lock_guard<std::mutex> lock(mutex_);
    Heartbeat& kept = sent_[static_cast<uint32_t>(heartbeat) % kKept];
    if (kept.heartbeat != heartbeat || heartbeat == last_) return 0;
    last_ = heartbeat;
    return kept.host_s;
  }

 private:
  struct Heartbeat {
    int32_t heartbeat = 0;
    double host_s = 0;
  };
  static constexpr int kKept = 256;
  std::mutex mutex_;
  std::array<Heartbeat, kKept> sent_{};
  int32_t last_ = 0;
};

class UrArmOnTcp final : public UrArm {
 public:
  UrArmOnTcp(const UrArmOptions& options, const UrKinematics& nominal, ChangeNotifier* changes)
      : options_(options),
        changes_(changes),
        nominal_(nominal),
        tip_from_flange_(options.script.flange_from_tip.inverse()),
        history_(kHistoryS, static_cast<size_t>(1.5 * kHistoryS * RateOf(options.model))),
        clock_(options.script.time_scale),
        dashboard_(options.address, options.dashboard_port),
        primary_(options.address, options.primary_port,
                 [this](const PrimaryUpdate& update) { OnPrimary(update); }),
        programs_(options.address, options.secondary_port, nullptr),
        stops_(options.address, options.secondary_port, nullptr),
        rtde_(
            {options.address, options.rtde_port, RateOf(options.model), 4 * options.frozen_after_s + 1},
            [this](const RtdeSample& sample, double host_s) { OnSample(sample, host_s); },
            [this] { changes_->Notify(); }) {}

  absl::StatusOr<ArmState> State() const override;
  std::vector<ArmState> History(double from_controller_s, double to_controller_s) const override {
    std::lock_guard<std::mutex> lock(mutex_);
    return history_.Between(from_controller_s, to_controller_s);
  }
  absl::Status Ready() const override;
  absl::Status StartTouch(const ArmTouch& touch) override;
  absl::Status MoveThrough(uint32_t program_id, const std::vector<Eigen::Isometry3d>& poses,
                           const std::vector<std::array<double, 6>>& joints) override;
  absl::Status BeginApproach(uint32_t program_id) override { return Command(program_id, kCommandGo); }
  absl::Status EndApproach(uint32_t program_id) override { return Command(program_id, kCommandRetract); }
  absl::Status Stop() override;
  absl::Status PowerOn(const std::function<absl::Status()>& guard) override;
  void SendHeartbeat() override;
  absl::Status WriteHeartbeat();  // inputs_mutex_ is held

  ClockEstimate ControllerClock() const override {
    std::lock_guard<std::mutex> lock(mutex_);
    return clock_.Estimate();
  }
  double StateRateHz() const override {
    std::lock_guard<std::mutex> lock(mutex_);
    return history_.RateHz();
  }
  std::string Model() const override { return options_.model; }
  std::string Address() const override { return options_.address; }
  std::string Version() const override { return rtde_.ControllerVersion(); }
  std::optional<DhTable> CalibratedKinematics() const override {
    std::lock_guard<std::mutex> lock(mutex_);
    return kinematics_;
  }
  bool ProgramPortsConnected() const { return programs_.Connected() && stops_.Connected(); }

 private:
  struct Start {
    uint32_t program_id = 0;  // 0: none that is waited for
    double sent_host_s = 0;
    std::string complaint;  // what the controller said since
    bool refused = false;   // and that was the end of it
  };

  void OnSample(const RtdeSample& sample, double host_s);
  void OnPrimary(const PrimaryUpdate& update);
  absl::Status Begin(uint32_t program_id, const std::string& program);
  absl::Status Command(uint32_t program_id, int command);
  absl::Status SendStop();
  // How fast each line of a way is gone.
  std::vector<double> Speeds(const ArmState& from, const std::vector<Eigen::Isometry3d>& way) const;
  // Why the program that was sent last has not begun, if it should have by now. With mutex_ held.
  absl::Status StartFailure() const;

  const UrArmOptions options_;
  ChangeNotifier* const changes_;
  const UrKinematics nominal_;
  const Eigen::Isometry3d tip_from_flange_;

  mutable std::mutex mutex_;  // of what follows
  StateHistory history_;
  ClockSync clock_;
  Start start_;
  std::optional<DhTable> kinematics_;

  mutable std::atomic<bool> suspect_{false};  // a program did not begin
  std::mutex inputs_mutex_;                   // of the registers
  int32_t heartbeat_ = 0, command_ = 0;
  SentHeartbeats sent_heartbeats_;
  std::atomic<uint64_t> stop_count_{0};
  std::atomic<bool> withhold_heartbeats_{false};

  mutable DashboardClient dashboard_;
  // Last: their threads use what stands above.
  ScriptPort primary_, programs_, stops_;
  RtdeClient rtde_;
};

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
  state.program_id = static_cast<uint32_t>(sample.program_register);
  state.phase = static_cast<MotionPhase>(sample.phase_register);

  // The controller sends the pose of whatever tool was set last; ours may not have been set yet.
  const Eigen::Isometry3d base_from_tcp = PoseFromVector(sample.actual_tcp_pose);
  const Eigen::Vector3d turning(sample.actual_tcp_speed[3], sample.actual_tcp_speed[4],
                                sample.actual_tcp_speed[5]);
  state.tip_velocity_m_s << sample.actual_tcp_speed[0], sample.actual_tcp_speed[1],
      sample.actual_tcp_speed[2];
  state.base_from_tip = base_from_tcp;
  if (sample.has_tcp_offset) {
    state.base_from_tip =
        base_from_tcp * PoseFromVector(sample.tcp_offset).inverse() * options_.script.flange_from_tip;
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
  if (start_.program_id == 0 || !update.is_error) return;
  start_.complaint = update.message;
  start_.refused = start_.refused || update.is_exception;
  if (start_.refused) changes_->Notify();
}

absl::Status UrArmOnTcp::StartFailure() const {
  if (start_.program_id == 0) return absl::OkStatus();
  const double waited_s = HostNowS() - start_.sent_host_s;
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
  const double age_s = HostNowS() - newest->host_time_s;
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
  if (suspect_ && options_.model == "ur3e") {
    const absl::StatusOr<std::string> remote = dashboard_.Ask("is in remote control", kDashboardS);
    if (remote.ok() && absl::AsciiStrToLower(*remote) == "false")
      return absl::FailedPreconditionError(
          "the controller is in local control and runs no programs from outside: switch it to remote control "
          "at the "
          "teach pendant");
  }
  return absl::OkStatus();
}

absl::Status UrArmOnTcp::Begin(uint32_t program_id, const std::string& program) {
  if (program_id == 0 || program_id >= 1u << 28)
    return absl::InvalidArgumentError(
        absl::StrCat("program id ", program_id, ": must be from 1 to ", (1u << 28) - 1));
  const uint64_t stops = stop_count_;
  withhold_heartbeats_ = false;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    start_ = Start{program_id, HostNowS(), "", false};
  }
  SendHeartbeat();
  // A stop that comes while the program goes out must reach the controller behind it.
  const auto stop_behind = [&] { return stop_count_ != stops ? StopProgram() : std::string(); };
  const absl::Status sent = programs_.Send(program, stop_behind);
  if (stop_count_ != stops) {
    SendStop().IgnoreError();
    return absl::AbortedError(absl::StrCat("program ", program_id, " was stopped before it began"));
  }
  if (!sent.ok()) {
    std::lock_guard<std::mutex> lock(mutex_);
    start_ = Start();
  }
  return sent;
}

std::vector<double> UrArmOnTcp::Speeds(const ArmState& from,
                                       const std::vector<Eigen::Isometry3d>& way) const {
  std::vector<double> speeds_m_s;
  Joints joints = from.joints_rad;
  Eigen::Isometry3d at = from.base_from_tip;
  for (const Eigen::Isometry3d& pose : way) {
    speeds_m_s.push_back(LimitedCartesianSpeed(nominal_, tip_from_flange_, at, pose,
                                               options_.script.transit_speed_m_s, &joints));
    at = pose;
  }
  return speeds_m_s;
}

absl::Status UrArmOnTcp::StartTouch(const ArmTouch& touch) {
  if (touch.transit.empty()) return absl::InvalidArgumentError("a touch needs a start");
  if (!(touch.speed_m_s > 0)) return absl::InvalidArgumentError("a touch needs a speed above 0");
  TOUCHSTONE_RETURN_IF_ERROR(Ready());
  TOUCHSTONE_ASSIGN_OR_RETURN(const ArmState now, State());
  std::vector<Eigen::Isometry3d> way = touch.transit;
  way.push_back(touch.end);  // as fast as it could be gone down, it can be gone up
  return Begin(touch.program_id, TouchProgram(touch, Speeds(now, way), options_.script));
}

absl::Status UrArmOnTcp::MoveThrough(uint32_t program_id, const std::vector<Eigen::Isometry3d>& poses,
                                     const std::vector<std::array<double, 6>>& joints) {
  TOUCHSTONE_RETURN_IF_ERROR(Ready());
  TOUCHSTONE_ASSIGN_OR_RETURN(const ArmState now, State());
  return Begin(program_id, MoveProgram(program_id, poses, Speeds(now, poses), joints, options_.script));
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
  sent_heartbeats_.Sent(heartbeat_, HostNowS());
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
  DashboardClient dashboard(options_.address, options_.dashboard_port);  // nobody else waits for this one
  return dashboard.Demand("stop", "Stopped", kStopDashboardS);
}

absl::Status UrArmOnTcp::Stop() {
  ++stop_count_;
  const absl::Status status = SendStop();
  {
    std::lock_guard<std::mutex> lock(mutex_);
    start_ = Start();
  }
  changes_->Notify();
  if (status.ok()) return status;
  withhold_heartbeats_ = true;
  return absl::UnavailableError(absl::StrCat(
      "the stop could not be sent to the controller at ", options_.address, " (", status.message(),
      "): its watchdog stops a running program soon; press the emergency stop if anything moves"));
}

absl::Status UrArmOnTcp::PowerOn(const std::function<absl::Status()>& guard) {
  const double until_s = HostNowS() + kPowerOnHostS + kPowerOnRigS / options_.script.time_scale;
  bool powered = false, released = false;
  while (true) {
    const uint64_t seen = changes_->count();
    TOUCHSTONE_RETURN_IF_ERROR(guard());
    TOUCHSTONE_ASSIGN_OR_RETURN(const ArmState state, State());
    if (state.robot_mode == RobotMode::kRunning) return SafetyPermitsMotion(state.safety_mode);
    TOUCHSTONE_RETURN_IF_ERROR(SafetyPermitsMotion(state.safety_mode));
    if (!powered && state.robot_mode < RobotMode::kIdle) {
      TOUCHSTONE_RETURN_IF_ERROR(dashboard_.Demand("power on", "Powering on", kDashboardS));
      powered = true;
    } else if (!released && state.robot_mode == RobotMode::kIdle) {
      TOUCHSTONE_RETURN_IF_ERROR(dashboard_.Demand("brake release", "Brake releasing", kDashboardS));
      released = true;
    }
    if (HostNowS() > until_s)
      return absl::UnavailableError(absl::StrCat("the arm was powered on but its mode is still ",
                                                 RobotModeName(state.robot_mode),
                                                 ": look at the teach pendant"));
    changes_->WaitForChange(seen, 0.1);
  }
}

}  // namespace

absl::StatusOr<std::unique_ptr<UrArm>> ConnectUrArm(const UrArmOptions& options, ChangeNotifier* changes) {
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
  const double until_s = HostNowS() + options.connect_wait_s;
  while ((!arm->State().ok() || !arm->ProgramPortsConnected()) && HostNowS() < until_s) {
    const uint64_t seen = changes->count();
    changes->WaitForChange(seen, 0.01);
  }
  return std::unique_ptr<UrArm>(std::move(arm));
}

}  // namespace touchstone
