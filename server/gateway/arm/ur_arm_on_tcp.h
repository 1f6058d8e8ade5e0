// The arm over its four TCP interfaces: RTDE for states and registers, the secondary one for programs and stops,
// the primary one for messages, the dashboard for power.
#pragma once

#include <array>
#include <atomic>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "server/gateway/arm/kinematics/arm_body.h"
#include "server/gateway/arm/protocol/dashboard_client.h"
#include "server/gateway/arm/protocol/registers.h"
#include "server/gateway/arm/protocol/rtde_client.h"
#include "server/gateway/arm/protocol/script_port.h"
#include "server/gateway/arm/state_history.h"
#include "server/gateway/arm/ur_arm.h"

namespace touchstone::gateway::arm {

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
  UrArmOnTcp(const UrArmOptions& options, const UrKinematics& nominal, timing::ChangeNotifier* changes);

  // ur_arm_states.cpp
  absl::StatusOr<ArmState> State() const override;
  std::vector<ArmState> History(double from_controller_s, double to_controller_s) const override {
    std::lock_guard<std::mutex> lock(mutex_);
    return history_.Between(from_controller_s, to_controller_s);
  }
  absl::Status Ready() const override;
  absl::Status StartTouch(const ArmTouch& touch, const StartGuard& guard) override;
  absl::Status MoveThrough(uint32_t program_id, const std::vector<Eigen::Isometry3d>& poses,
                           const std::vector<std::array<double, 6>>& joints,
                           const StartGuard& guard) override;
  absl::Status BeginMotion(uint32_t program_id, const StartGuard& guard) override {
    return SendStart(guard, [&] { return Command(program_id, kCommandMove); });
  }
  absl::Status BeginApproach(uint32_t program_id, const StartGuard& guard) override {
    return SendStart(guard, [&] { return Command(program_id, kCommandGo); });
  }
  absl::Status StartFreedrive(uint32_t program_id, const StartGuard& guard) override;
  absl::Status EndApproach(uint32_t program_id) override { return Command(program_id, kCommandRetract); }
  absl::Status Stop() override;
  absl::Status StopOtherwise() override;
  ForeignPrograms Foreign() const override {
    std::lock_guard<std::mutex> lock(mutex_);
    return foreign_;
  }
  absl::Status PowerOn(const StartGuard& guard) override;
  void SendHeartbeat() override;
  absl::Status WriteHeartbeat();  // inputs_mutex_ is held

  timing::ClockEstimate ControllerClock() const override {
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
  // The primary one too: it tells when a program of somebody else begins.
  bool ProgramPortsConnected() const {
    return programs_.Connected() && stops_.Connected() && primary_.Connected();
  }

 private:
  struct Start {
    uint32_t program_id = 0;  // sent, and not begun yet; 0: none
    double sent_host_s = 0;
    std::string complaint;  // the controller's error message since
    bool refused = false;   // it will not begin
  };

  void OnSample(const RtdeSample& sample, double host_s);
  void OnPrimary(const PrimaryUpdate& update);
  absl::Status Begin(uint32_t program_id, const std::string& program, const StartGuard& guard);
  // Sends what starts motion, unless the guard forbids it; a stop waits for it, or comes before the guard is asked.
  absl::Status SendStart(const StartGuard& guard, const std::function<absl::Status()>& send);
  absl::Status TakePowerSteps(const StartGuard& guard, bool* began);
  absl::Status DemandPower(const std::string& command, const std::string& expected, const StartGuard& guard,
                           bool* sent);
  absl::Status PowerOffAgain(const absl::Status& why);
  absl::Status Command(uint32_t program_id, int command);
  absl::Status SendStop();
  // The tip's speed on each line of a path, m/s.
  // *joints become those of its end.
  std::vector<double> Speeds(const ArmState& from, const std::vector<Eigen::Isometry3d>& path,
                             Joints* joints) const;
  // Its own, once the controller has sent them.
  UrKinematics Kinematics() const;
  // Why the program that was sent last has not begun, if it should have by now. With mutex_ held.
  absl::Status StartFailure() const;

  const UrArmOptions options_;
  timing::ChangeNotifier* const changes_;
  const UrKinematics nominal_;
  const ArmBody body_;
  const Eigen::Isometry3d tip_from_flange_;

  mutable std::mutex mutex_;  // of what follows
  StateHistory history_;
  timing::ClockSync clock_;
  Start start_;
  std::optional<DhTable> kinematics_;
  std::deque<std::string> sent_programs_;  // names of the last ones
  ForeignPrograms foreign_;

  mutable std::atomic<bool> suspect_{false};  // a program did not begin
  std::mutex inputs_mutex_;                   // of the registers
  int32_t heartbeat_ = 0, command_ = 0;
  SentHeartbeats sent_heartbeats_;
  std::timed_mutex start_mutex_;  // held while something that starts motion goes out
  std::atomic<uint64_t> stop_count_{0};
  std::atomic<bool> withhold_heartbeats_{false};

  mutable DashboardClient dashboard_;
  // Last: their threads use what stands above.
  ScriptPort primary_, programs_, stops_;
  RtdeClient rtde_;
};

}  // namespace touchstone::gateway::arm
