// An arm that a test moves by hand: it sends what it is told to, and keeps count of what it was sent. For tests.
#pragma once

#include <algorithm>
#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "server/gateway/arm/arm.h"
#include "server/gateway/arm/kinematics/kinematics.h"
#include "server/gateway/arm/kinematics/motion_limits.h"

namespace touchstone::gateway {

class ScriptedArm : public arm::Arm {
 public:
  static constexpr double kCycleS = 0.002;

  explicit ScriptedArm(timing::ChangeNotifier* changes = nullptr) : changes_(changes) {
    const arm::MotionLimits limits;
    state_.joints_rad = limits.home_rad;
    state_.base_from_tip = arm::UrKinematics::ForModel("ur3e").value().Forward(limits.home_rad);
    state_.robot_mode = arm::RobotMode::kRunning;
    state_.safety_mode = arm::SafetyMode::kNormal;
    state_.runtime_state = arm::RuntimeState::kStopped;
    state_.speed_scaling = state_.target_speed_fraction = 1;
    Change([](arm::ArmState*) {});
  }
  // The next state that the controller sends.
  void Change(const std::function<void(arm::ArmState*)>& change) {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      const double before_s = state_.controller_time_s, host_before_s = state_.host_time_s;
      state_.host_time_s = timing::HostNowS();
      change(&state_);
      if (state_.controller_time_s == before_s) state_.controller_time_s += kCycleS;
      state_.host_time_s = std::max(state_.host_time_s, host_before_s);
      history_.push_back(state_);
    }
    if (changes_ != nullptr) changes_->Notify();
  }
  // The same states for so long.
  void Pass(double seconds) {
    for (double passed_s = 0; passed_s < seconds; passed_s += kCycleS) Change([](arm::ArmState*) {});
  }
  void SetSafety(arm::SafetyMode mode) {
    Change([mode](arm::ArmState* state) { state->safety_mode = mode; });
  }
  void SetProgram(uint32_t id, arm::MotionPhase phase, arm::RuntimeState runtime) {
    Change([=](arm::ArmState* state) {
      state->program_id = id, state->phase = phase, state->runtime_state = runtime;
    });
  }
  // What was sent so far is gone, as after the controller was started anew.
  void Forget() {
    std::lock_guard<std::mutex> lock(mutex_);
    history_.clear();
  }

  absl::StatusOr<arm::ArmState> State() const override {
    std::lock_guard<std::mutex> lock(mutex_);
    if (!link_.ok()) return link_;
    return state_;
  }
  std::vector<arm::ArmState> History(double from_s, double to_s) const override {
    std::lock_guard<std::mutex> lock(mutex_);
    std::vector<arm::ArmState> states;
    for (const arm::ArmState& state : history_)
      if (state.controller_time_s >= from_s && state.controller_time_s <= to_s) states.push_back(state);
    return states;
  }
  void SetLink(const absl::Status& status) {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      link_ = status;
    }
    if (changes_ != nullptr) changes_->Notify();
  }
  absl::Status Ready() const override { return State().status(); }
  absl::Status StartTouch(const arm::ArmTouch&, const arm::StartGuard&) override {
    return absl::UnimplementedError("no touches here");
  }
  absl::Status MoveThrough(uint32_t id, const std::vector<Eigen::Isometry3d>&,
                           const std::vector<std::array<double, 6>>&, const arm::StartGuard& guard) override {
    if (before_send) before_send();
    if (absl::Status allowed = guard(); !allowed.ok()) return allowed;
    SetProgram(id, arm::MotionPhase::kNone, arm::RuntimeState::kPlaying);
    if (while_prepared) Change(while_prepared);
    Pass(0.1);
    ++programs;
    return absl::OkStatus();
  }
  absl::Status BeginMotion(uint32_t id, const arm::StartGuard& guard) override {
    if (absl::Status allowed = guard(); !allowed.ok()) return allowed;
    SetProgram(id, arrives ? arm::MotionPhase::kDone : arm::MotionPhase::kTransit,
               arm::RuntimeState::kPlaying);
    if (arrives) Rest();
    ++motions;  // last: a test that sees it changes the state
    return absl::OkStatus();
  }
  absl::Status BeginApproach(uint32_t, const arm::StartGuard&) override { return absl::OkStatus(); }
  absl::Status EndApproach(uint32_t) override { return absl::OkStatus(); }
  absl::Status Stop() override {
    ++stops;
    if (on_stop) on_stop();
    if (heeds_stops) Rest();
    return absl::OkStatus();
  }
  absl::Status StopOtherwise() override {
    ++other_stops;
    if (heeds_other_stops) Rest();
    return absl::OkStatus();
  }
  arm::ForeignPrograms Foreign() const override {
    std::lock_guard<std::mutex> lock(mutex_);
    return foreign_;
  }
  // One more program of somebody else began.
  void BeginForeign(const std::string& name) {
    std::lock_guard<std::mutex> lock(mutex_);
    ++foreign_.count, foreign_.newest = name;
  }
  absl::Status PowerOn(const arm::StartGuard&) override { return absl::OkStatus(); }
  void SendHeartbeat() override { ++heartbeats; }
  timing::ClockEstimate ControllerClock() const override { return {}; }
  double StateRateHz() const override { return 1 / kCycleS; }
  std::string Model() const override { return "ur3e"; }
  std::string Address() const override { return "a test"; }
  std::string Version() const override { return "0"; }

  std::function<void()> before_send;
  std::function<void(arm::ArmState*)> while_prepared;  // a state between a program's settings and its motion
  std::atomic<bool> arrives{false};                    // a motion is done as soon as it begins
  std::function<void()> on_stop;                       // called by Stop, if it is set
  std::atomic<bool> heeds_stops{true}, heeds_other_stops{true};
  std::atomic<int> programs{0}, motions{0}, stops{0}, other_stops{0}, heartbeats{0};

 private:
  void Rest() {
    Change([](arm::ArmState* state) { state->runtime_state = arm::RuntimeState::kStopped; });
    Pass(0.1);
  }

  timing::ChangeNotifier* const changes_;
  mutable std::mutex mutex_;
  arm::ArmState state_;
  std::vector<arm::ArmState> history_;
  arm::ForeignPrograms foreign_;
  absl::Status link_;
};

}  // namespace touchstone::gateway
